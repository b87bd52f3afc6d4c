"""How deep a pad presses into an object, as effects in the contact need it."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect

# the right finger stands on the object's positive side
_TOWARDS_OBJECT = np.array([1, -1])


def untouched(which: np.ndarray) -> np.ndarray:
    """The entry ``"surface"`` in the memory of effects that ask for a depth: surfaces of objects not yet felt."""
    return np.full((len(which), 2), -np.inf)


def depth_in_object(effect: Effect, force: np.ndarray, reach: np.ndarray | None = None) -> np.ndarray:
    """Depth of the pads below the surface, metres, ``(rows, 2)``; negative above it, −inf before the first touch.

    Once an object is felt, its shape says where its surface is. The contact's own force does not tell: a contact that
    opens has no force left long before it ends.

    Args:
      effect: whose rows, plant and memory of the surface it is.
      force: forces of the contact itself, newtons, ``(rows, 2)``.
      reach: of the pads, from :func:`pad_reach`; asked for by default.
    """
    surface, reach = effect.state["surface"], pad_reach(effect) if reach is None else reach
    felt = (force > 0) & np.isinf(surface)
    if felt.any():
        new = np.flatnonzero(felt.any(axis=1))
        met = surface.copy()
        met[new] = (reach - effect.plant.pad_shift_m[effect.rows])[new] - effect.plant.clearance(effect.rows[new]).min(
            axis=-1
        )
        effect.state["surface"] = surface = np.where(felt, met, surface)
    return surface - reach


def pad_reach(effect: Effect) -> np.ndarray:
    """How far pads stand from the object's middle, from where they are when closed on it, metres, ``(rows, 2)``."""
    plant, at = effect.plant, effect.at
    return plant.pad_position[at] + plant.pad_shift_m[at] + plant.object_position[at, None] * _TOWARDS_OBJECT


def contact_push(push: np.ndarray) -> Contribution:
    """A force between pads and object, newtons, ``(rows, 2)``: it opens the fingers, and the object feels both."""
    return Contribution(finger_push_n=push, object_push_n=push[:, 0] - push[:, 1])
