"""Trainings that take a fraction of a second, and what they leave behind."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import pytest

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.config import TrainConfig, validate
from forcegrasp.physics import load_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.loop import train

TINY = {
    "grasp": {"steps": 30},
    "physics": {"threads": 1},
    "ppo": {"total_frames": 300, "grasps": 2, "epochs": 2, "minibatch": 32, "hidden": [8], "initial_action": -1.0},
    "log": {"histograms_every": 0, "figures_every": 0, "video_every": 0, "checkpoint_every": 100},
}


def tiny_config(seed: int = 0, gripper: str = DEFAULT_GRIPPER, **sections: dict) -> TrainConfig:
    config = TrainConfig(seed=seed, gripper=gripper)
    for options in (TINY, sections):
        for section, values in options.items():
            owner = getattr(config, section)
            for name, value in values.items():
                assert hasattr(owner, name), name
                setattr(owner, name, value)
    validate(config)
    return complete(config, load_gripper(config.gripper))


def read_metrics(run: RunDir) -> list[dict[str, float]]:
    """Rows of metrics.csv, less the columns that tell the machine's speed."""
    with open(run.metrics_path, newline="") as file:
        return [{k: float(v) for k, v in row.items() if not k.startswith("speed/")} for row in csv.DictReader(file)]


def train_in(path: Path, config: TrainConfig) -> RunDir:
    run = RunDir.create(path, config, [])
    assert train(config, run)
    return run


@pytest.fixture(scope="session")
def tiny() -> Callable[..., TrainConfig]:
    """``tiny(seed=0, gripper="NAME", ppo={...}, ...)``: five batches of two short grasps, unless told otherwise."""
    return tiny_config


@pytest.fixture(scope="session")
def trained() -> Callable[[Path, TrainConfig], RunDir]:
    """Trains in a new run directory, to the end."""
    return train_in


@pytest.fixture(scope="session")
def metrics() -> Callable[[RunDir], list[dict[str, float]]]:
    return read_metrics
