"""Readings come in steps."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter


class Quantisation(Effect):
    """Positions and forces are rounded to multiples of a step."""

    name = "quantisation"
    stage = "sensor"
    family = "resolution"
    symptom = "few distinct values"
    formula = "y' = s round(y / s)"
    source = "resolution of the converter"
    look_alikes = ()
    separates = "counting the distinct values tells it from everything else"
    parameters = (
        Parameter("position_step_m", "step of the positions, if any", "m", 0.0, 0.005, 1e-4, follows="position"),
        Parameter("force_step_n", "step of the forces, if any", "N", 0.0, 1.0, 0.04, follows="force"),
    )
    order = 11
    after_noise = True

    @classmethod
    def trials(cls) -> np.ndarray:
        return np.empty((0, 2))  # judged by counting, see forcegrasp.measure.rounding

    def read_force(self, force: np.ndarray) -> np.ndarray:
        return _round(force, self["force_step_n"])

    def read_position(self, position: np.ndarray) -> np.ndarray:
        return _round(position, self["position_step_m"])


def _round(value: np.ndarray, step: np.ndarray) -> np.ndarray:
    whole = np.where(step > 0, step, 1.0)
    return np.where(step > 0, whole * np.round(value / whole), value)
