"""The contact yields with time."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter, first_order_weight


class ViscoelasticContact(Effect):
    """A Kelvin-Voigt element in series with the elastic contact: a standard linear solid at the pad."""

    name = "viscoelastic_contact"
    stage = "contact"
    symptom = "force decays during a hold while the finger creeps inward; the peak depends on speed"
    formula = "τ dδ/dt = c F_pad − δ"
    source = "standard linear solid (Fung 1965)"
    look_alikes = ("finger_compliance", "force_drift", "force_lag")
    separates = "long holds: force and position relax together, and only in contact"
    parameters = (
        Parameter("creep_m_n", "final creep per force c", "m/N", 0.0, 0.03, 0.002, trials=(5e-4, 2e-3)),
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
    order = 1

    def reset(self, which: np.ndarray) -> None:
        if not hasattr(self, "_creep"):
            self._creep = np.zeros((len(self.values), 2))
        self._creep[which] = 0

    def act(self) -> None:
        gap = self["creep_m_n"] * self.pad_force - self._creep
        self._creep = self._creep + first_order_weight(self.dt, self["time_constant_s"]) * gap
        self.plant.pad_shift_m[self.rows] += self._creep
