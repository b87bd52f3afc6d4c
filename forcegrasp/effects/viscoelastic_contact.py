"""The contact yields with time."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Parameter, State
from forcegrasp.effects.touch import contact_push, depth_in_object, untouched


class ViscoelasticContact(Effect):
    """A Maxwell branch beside the elastic contact: a standard linear solid at the pad.

    ``recovering``: the branch only pushes, and what has yielded comes back as slowly, also once nothing presses.
    ``following``: what the branch would hold back comes along at once, so that a touch finds it as the first one did.
    ``solid``: the branch holds back, too, while the contact as a whole still pushes: what is relieved presses less than
    at rest. ``solid_by_object``: the same, and k goes with the stiffness of each object's contact, so that it is that
    on one as stiff as the scene's.
    """

    name = "viscoelastic_contact"
    stage = "contact"
    family = "contact"
    needs_object = True
    symptom = "force decays during a hold while the finger creeps inward; the peak depends on speed"
    formula = (
        "F = F_contact + max(0, k (δ − x)), τ dx/dt = δ − x, δ the depth of the pad in the object; x ≤ δ (following);"
        " F = max(0, F_contact + k (δ − x)) (solid), k times an object's stiffness ÷ the scene's (solid_by_object)"
    )
    source = "standard linear solid, Zener's form (Fung 1965)"
    look_alikes = ("finger_compliance", "finger_creep", "force_drift", "force_lag")
    separates = "long holds: force and position relax together, and only in contact"
    parameters = (
        Parameter(
            "stiffness_n_m", "stiffness k of the branch", "N/m", 0.0, 2000.0, 80.0, trials=(20.0, 80.0), follows="force"
        ),
        Parameter(
            "time_constant_s",
            "time constant τ",
            "s",
            0.03,
            20.0,
            0.5,
            null=0.5,
            logarithmic=True,
            trials=(0.1, 0.4, 1.5),
        ),
    )
    variants = ("recovering", "following", "solid", "solid_by_object")
    variant_needs = {"solid_by_object": "stiffness of objects"}  # noqa: RUF012 never changed
    order = 1

    def init(self, which: np.ndarray) -> State:
        relaxed, push = np.zeros((2, len(which), 2))
        firm = np.ones((len(which), 1))
        if self.variant == "solid_by_object":
            firm = self.plant.contact_factors(self.rows[which])[:, 1:]
        return {"surface": untouched(which), "relaxed": relaxed, "push": push, "firm": firm}

    def act(self) -> Contribution:
        depth, before = np.maximum(depth_in_object(self, self.pad_force), 0.0), self.state["relaxed"]
        relaxed = before + self.lag_weight("time_constant_s") * (depth - before)
        if self.variant == "following":
            relaxed = np.minimum(relaxed, depth)
        least = -self.pad_force if self.variant.startswith("solid") else 0.0
        push = np.maximum(self["stiffness_n_m"] * self.state["firm"] * (depth - relaxed), least)
        self.state.update(relaxed=relaxed, push=push)
        return contact_push(push)

    def interaction(self, force: np.ndarray) -> np.ndarray:
        return force + self.state["push"]
