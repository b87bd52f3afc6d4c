"""How deep a pad presses into an object, as effects in the contact need it."""

from __future__ import annotations

import numpy as np

from forcegrasp.physics.plant import Plant


class Touch:
    """Follows the pads of some rows; an object's surface is where it was first felt.

    The contact's own force does not tell: a contact that opens has no force left long before it ends.
    """

    def __init__(self, rows: int) -> None:
        self._surface = np.full((rows, 2), -np.inf)

    def reset(self, which: np.ndarray) -> None:
        """Forgets the surfaces of these rows."""
        self._surface[which] = -np.inf

    def depth(self, plant: Plant, rows: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Depth below the surface, metres, ``(rows, 2)``; negative above it, −inf before the first touch.

        Args:
          plant: whose state it is.
          rows: the rows.
          force: forces of the contact itself, newtons, ``(rows, 2)``.
        """
        # how far a pad stands from the object's middle; the right finger stands on its positive side
        reach = (
            plant.pad_position[rows] + plant.pad_shift_m[rows] + plant.object_position[rows, None] * np.array([1, -1])
        )
        self._surface = np.where((force > 0) & np.isinf(self._surface), reach, self._surface)
        return self._surface - reach
