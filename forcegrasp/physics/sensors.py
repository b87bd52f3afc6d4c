"""The sensor chain, in the one order in which everything is read: transduction, effects, noise, rounding.

Names along it, of forces as of positions: ``force`` is true, ``transduced_force`` goes into the reading,
``measured_force`` has been through effects, ``sensed_force`` through noise and rounding, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from forcegrasp.physics.protocols import PlantEffect


def is_rounding(effect: type[PlantEffect]) -> bool:
    """Whether an effect comes after the noise, as a converter's rounding does: readings lie on its grid."""
    return effect.after_noise


def rounding_steps(effects: Iterable[tuple[type[PlantEffect], np.ndarray]]) -> np.ndarray:
    """Steps that positions and forces are rounded to after the noise, ``(2,)``; 0 rounds nothing.

    Args:
      effects: each with the values of its parameters; those that do not round are left out.
    """
    return next((values for effect, values in effects if is_rounding(effect)), np.zeros(2))


class ReadingEffects:
    """Effects between a transducer and the noise, on rows of their own, in the order of their stages.

    Args:
      effects: any; those that change no reading, or come after the noise, are left out.
    """

    def __init__(self, effects: Sequence[PlantEffect]) -> None:
        live = sorted((e for e in effects if e.reads() and not is_rounding(type(e))), key=lambda e: e.rank)
        self._force = [e for e in live if "read_force" in e.hooks()]
        self._position = [e for e in live if "read_position" in e.hooks()]

    @property
    def change_position(self) -> bool:
        """Whether positions are changed at all."""
        return bool(self._position)

    def __len__(self) -> int:
        return len(self._position) + len(self._force)

    def apply(self, position: np.ndarray, force: np.ndarray) -> None:
        """Changes what was transduced at one instant, in place: ``(n, motors)`` and ``(n, channels)``."""
        for effect in self._position:
            position[effect.rows] = effect.read_position(position[effect.rows])
        for effect in self._force:
            force[effect.rows] = effect.read_force(force[effect.rows])

    def apply_to_all(self, position: np.ndarray, force: np.ndarray) -> None:
        """The same of all instants of grasps, ``(n, steps, motors)`` and ``(n, steps, channels)``."""
        if set(self._position) & set(self._force):  # what knows both, as a law does, is to see them of one instant
            for step in range(position.shape[1]):
                self.apply(position[:, step], force[:, step])
            return
        for effect in self._position:
            position[effect.rows] = effect.read_positions(position[effect.rows].swapaxes(0, 1)).swapaxes(0, 1)
        for effect in self._force:
            force[effect.rows] = effect.read_forces(force[effect.rows].swapaxes(0, 1)).swapaxes(0, 1)


def with_noise(value: Any, std: Any, normal: Any, step: float = 0.0) -> Any:
    """A reading: noise added, and then rounded as the converter does.

    Args:
      value: what comes out of the effects; a numpy array or a torch tensor.
      std: of the noise, in the value's unit; a number, or an array that broadcasts.
      normal: standard normal numbers of the value's shape.
      step: of the converter, in the value's unit; 0 rounds nothing.
    """
    noisy = value + std * normal
    return noisy if step == 0 else step * (noisy / step).round()
