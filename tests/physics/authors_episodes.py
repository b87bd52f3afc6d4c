"""The authors' recorded episodes as far as a clone has them: parameters, actions, and six instants of what came of it.

Source: the simulator of Lach et al. (2023) with the collision code of the paper's time, without noise, values after the
step. ``authors_episodes.csv`` says what was done, ``authors_instants.csv`` what came of it at the same steps of each.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from forcegrasp.physics import GraspParameters

STEPS = 150
#: Of the random actions: the mean of those that drift, and how much of a deviation from it is left after a step.
MEAN, MEMORY = -0.25, 0.9


def read(path: Path) -> list[dict[str, str]]:
    """Rows of a CSV file."""
    return list(csv.DictReader(path.read_text("utf-8").splitlines()))


EPISODES = read(Path(__file__).with_name("authors_episodes.csv"))
INSTANTS = read(Path(__file__).with_name("authors_instants.csv"))


def parameters(rows: list[dict[str, str]]) -> GraspParameters:
    """Grasps by the columns that both tables of episodes have."""
    columns = ("kappa", "b2", "object_radius_m", "object_offset_m")
    return GraspParameters(*(np.array([float(row[c]) for row in rows]) for c in columns), 0.1)


def actions(told: str) -> np.ndarray:
    """Actions in [-1, 1] of left and right finger, ``(150, 2)``, from the column ``actions``.

    ``60 x -0.7 -0.7; 90 x 0.5 0.5`` is held for so many steps. Random ones are drawn after the four parameters of the
    grasp: ``uniform`` ones from [-1.3, 0.7], ``drifting`` ones as a first-order autoregressive process; both clipped.
    """
    kind, _, seed = told.partition(" seed ")
    if not seed:
        runs = [part.split() for part in told.split(";")]
        return np.concatenate([np.tile([float(left), float(right)], (int(n), 1)) for n, _, left, right in runs])
    rng = np.random.default_rng(int(seed))
    rng.random(4)
    if kind == "uniform":
        return np.clip(rng.uniform(-1.3, 0.7, (STEPS, 2)), -1, 1)
    deviation, drifting = np.zeros(2), []
    for shock in rng.normal(0, 0.25, (STEPS, 2)):
        deviation = MEMORY * deviation + shock
        drifting.append(MEAN + deviation)
    return np.clip(drifting, -1, 1)
