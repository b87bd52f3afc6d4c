"""Force columns that stand for one another."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter


class SwappedForces(Effect):
    """The left column of forces holds the right finger's, and the other way round."""

    name = "swapped_forces"
    stage = "sensor"
    family = "measurement set"
    of_set = True
    symptom = "where one finger touches first, the other one's force rises"
    formula = "f'_l = (1 − s) f_l + s f_r, f'_r = (1 − s) f_r + s f_l; s = 1 if they are swapped"
    source = "the measurement set, not the gripper"
    look_alikes = ("force_crosstalk", "force_gain_asymmetry")
    separates = "press on one finger by hand, and see which column moves"
    parameters = (Parameter("share", "s, how far they are swapped", "1", 0.0, 1.2, 1.0, trials=(1.0,)),)
    # in part they can't be: a small share is crosstalk, which is the same but for a gain
    least_size = 0.7
    least_channels = 2
    order = 10  # columns are exchanged after all that happens to a force

    def read_force(self, force: np.ndarray) -> np.ndarray:
        return np.where(self["share"] == 0, force, force + self["share"] * (force[:, ::-1] - force))
