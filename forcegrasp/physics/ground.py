"""How what objects stand on touches them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco
import numpy as np

if TYPE_CHECKING:
    from forcegrasp.physics.model_fields import ModelFields


def let_ground_decide(plant: ModelFields, ground: int, rows: np.ndarray) -> None:
    """Writes into a geom of the ground how it touches the object, so that changes of it are felt by no pad.

    MuJoCo takes a contact's numbers from the geom of higher priority, and mixes those of both where they are equal.
    """
    model, own = plant.model, int(plant.object_geoms[0])
    ahead = model.geom_priority[ground] - model.geom_priority[own]
    for name in ("geom_friction", "geom_condim", "geom_solref", "geom_solimp"):
        field = plant.field(name)
        if ahead < 0:
            field[rows, ground] = field[rows, own]
        elif ahead == 0:
            weights = np.maximum(model.geom_solmix[[ground, own]], mujoco.mjMINVAL)
            field[rows, ground] = _mixed(name, field[rows, ground], field[rows, own], weights[0] / weights.sum())
    plant.field("geom_priority")[rows, ground] = model.geom_priority.max() + 1


def _mixed(name: str, ground: np.ndarray, own: np.ndarray, share: float) -> np.ndarray:
    """What MuJoCo makes of a number that two geoms of equal priority have."""
    if name in ("geom_friction", "geom_condim"):
        return np.maximum(ground, own)
    mixed = share * ground + (1 - share) * own
    if name == "geom_solref":  # negative ones are stiffness and damping: the larger count
        are_times = (ground[:, :1] > 0) & (own[:, :1] > 0)
        return np.where(are_times, mixed, np.minimum(ground, own))
    return mixed
