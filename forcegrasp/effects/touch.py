"""How deep a pad presses into an object, as effects in the contact need it."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect


def untouched(which: np.ndarray) -> np.ndarray:
    """The entry ``"surface"`` in the memory of effects that ask for a depth: surfaces of objects not yet felt."""
    return np.full((len(which), 2), -np.inf)


def depth_in_object(effect: Effect, force: np.ndarray) -> np.ndarray:
    """Depth of the pads below the surface, metres, ``(rows, 2)``; negative above it, −inf before the first touch.

    An object's surface is where it was first felt. The contact's own force does not tell: a contact that opens has no
    force left long before it ends.

    Args:
      effect: whose rows, plant and memory of the surface it is.
      force: forces of the contact itself, newtons, ``(rows, 2)``.
    """
    plant, rows, surface = effect.plant, effect.rows, effect.state["surface"]
    # how far a pad stands from the object's middle; the right finger stands on its positive side
    reach = plant.pad_position[rows] + plant.pad_shift_m[rows] + plant.object_position[rows, None] * np.array([1, -1])
    effect.state["surface"] = surface = np.where((force > 0) & np.isinf(surface), reach, surface)
    return surface - reach


def contact_push(push: np.ndarray) -> Contribution:
    """A force between pads and object, newtons, ``(rows, 2)``: it opens the fingers, and the object feels both."""
    return Contribution(finger_push_n=push, object_push_n=push[:, 0] - push[:, 1])
