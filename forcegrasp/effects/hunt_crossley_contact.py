"""The contact is a spring and a damper of its own, in place of MuJoCo's."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Parameter, State
from forcegrasp.effects.touch import contact_push, depth_in_object, pad_reach, untouched
from forcegrasp.physics.plant import Plant

# What stays of MuJoCo's contact, to say that pads touch: its least impedance, and next to no stiffness and damping.
_FAINT_SOLIMP, _FAINT_SOLREF = (1e-4, 1e-4), (-0.05, -0.05)
# Trials press with so many newtons at a third of ρ.
_PRESS_N, _SHARE = 0.15, 1 / 3


class HuntCrossleyContact(Effect):
    """Pads and object press on each other by a power of the depth, and harder while they approach.

    MuJoCo's contacts have a curve of force over depth of their own, are damped strongly, and press by how the bodies
    accelerate. Here only depth and its rate count. Objects that the gripper's parameters make stiffer, or more damped,
    are so here, too, by the same factor. Pads press then and do not rub: the object has to stand on something.
    """

    name = "hunt_crossley_contact"
    stage = "contact"
    family = "contact"
    needs_object = True
    needs_parallel_pads = True
    instead_of = ("stiffening_contact", "contact_damping", "contact_onset")
    symptom = "force grows otherwise with the squeeze, at every speed; touches are less damped, or more"
    formula = (
        "F = F_ρ k/k₀ (δ / ρ)^p max(0, 1 + λ b/b₀ dδ/dt) in place of MuJoCo's, δ the depth, ρ the width of its solimp,"
        " k/k₀ and b/b₀ an object's stiffness and damping ÷ the scene's"
    )
    source = "Hunt and Crossley 1975; p is 1 of flat pads on a bed of springs, 1.5 of round bodies (Hertz 1882)"
    look_alikes = ("stiffening_contact", "viscoelastic_contact", "finger_compliance", "object_size", "force_deadzone")
    separates = "slow ramps to high force, and touches at several speeds"
    parameters = (
        Parameter(
            "force_n", "force F_ρ at a depth of ρ", "N", 0.01, 500.0, 1.0,
            null=np.inf, logarithmic=True, follows="force",
        ),
        Parameter("power", "power p", "1", 1.0, 8.0, 1.5, null=1.5),
        Parameter("damping_s_m", "damping λ", "s/m", 0.0, 100.0, 5.0, null=5.0),
    )  # fmt: skip
    order = -1

    @classmethod
    def trials(cls) -> np.ndarray:
        return np.array([[_PRESS_N / _SHARE**p, p, damping] for p in (1.0, 2.0, 4.0) for damping in (1.0, 10.0)])

    def init(self, which: np.ndarray) -> State:
        plant, rows = self.plant, self.rows[which]
        zero, factors = np.zeros((len(which), 2)), plant.contact_factors(rows)
        return {
            "surface": untouched(which),
            "reach": pad_reach(self)[which],
            "rate": zero,
            "push": zero.copy(),
            "width_m": plant.field("geom_solimp")[rows, plant.object_geoms[0], 2][:, None],
            "damped": factors[:, :1],
            "firm": factors[:, 1:],
            "mass": plant.mass_between(rows),
            # no motor can press harder; a long time step that overshoots must not be thrown back with more
            "strongest": plant.strongest_press(rows),
        }

    def change_model(self, plant: Plant, which: np.ndarray) -> None:
        rows = self.rows[which][np.isfinite(self["force_n"][which, 0])]
        for geom in plant.pad_geoms:
            plant.field("geom_priority")[rows, geom] = plant.model.geom_priority.max() + 1
            plant.field("geom_solimp")[rows, geom, :2] = _FAINT_SOLIMP
            plant.field("geom_solref")[rows, geom] = _FAINT_SOLREF

    def act(self) -> Contribution:
        state, dt, mass = self.state, self.dt, self.state["mass"]
        reach = pad_reach(self)
        rate = (state["reach"] - reach) / dt
        depth = np.maximum(depth_in_object(self, self.pad_force, reach), 0.0)
        there = np.isfinite(self["force_n"]) & (depth > 0)
        spring = np.where(there, self["force_n"] * state["firm"], 0.0) * (depth / state["width_m"]) ** self["power"]
        per_speed = self["damping_s_m"] * state["damped"]
        grown = 1 + per_speed * rate
        # Where a step is too long for so stiff or so damped a contact its force is that of the step's end, as far as
        # is needed; what else accelerates pad and object is what did in the last step.
        stiffness = self["power"] * spring * grown / np.maximum(depth, 1e-9)
        damping = per_speed * spring
        late_k, late_c = np.maximum(stiffness * dt - mass / dt, 0.0), np.maximum(damping - mass / dt, 0.0)
        others = rate - state["rate"] + state["push"] * dt / mass
        push = spring * grown + late_k * (rate + others) + late_c * others
        push = np.where(there, push / (1 + (late_k + late_c) * dt / mass), 0.0)
        state.update(reach=reach, rate=rate, push=np.clip(push, 0.0, state["strongest"]))
        return contact_push(state["push"])

    def interaction(self, force: np.ndarray) -> np.ndarray:
        return force + self.state["push"]
