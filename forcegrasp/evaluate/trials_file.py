"""Every trial of a comparison in one file."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from forcegrasp.env.episodes import METRICS
from forcegrasp.evaluate.grids import Grid


def write_trials(path: Path, grid: Grid, metrics: dict[str, dict[str, np.ndarray]]) -> None:
    """Writes a row per policy and grasp: its cell, its parameters, and what came of it.

    Args:
      path: the CSV file.
      grid: what was grasped.
      metrics: policy → metric → values, ``(cells, trials)``.
    """
    columns = ["policy", "cell", "kappa", "b2", "radius_m", "offset_m", "goal_force_n", *METRICS]
    cells = np.repeat(grid.cells, grid.trials)
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        for name, values in metrics.items():
            per_trial = np.stack([values[metric].reshape(-1) for metric in METRICS], axis=1)
            for cell, grasp, row in zip(cells, grid.grasps.as_array(), per_trial, strict=True):
                writer.writerow([name, cell, *(f"{x:.9g}" for x in grasp), *(f"{x:.6g}" for x in row)])
