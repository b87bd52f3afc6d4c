"""Command lines that train or evaluate for a blink, and a run made by one."""

from __future__ import annotations

from pathlib import Path

import pytest

from forcegrasp.cli.main import main

TINY_TRAINING = [
    "ppo.total_frames=8",
    "ppo.grasps=2",
    "grasp.steps=4",
    "ppo.hidden=[4]",
    "physics.threads=1",
    "log.figures_every=0",
    "log.video_every=0",
    "log.histograms_every=0",
]
TINY_EVALUATION = ["trials=2", "kappas=1", "grasp.steps=4", "physics=fast", "physics.threads=1"]


@pytest.fixture(scope="session")
def tiny() -> dict[str, list[str]]:
    """Verb → options that make it quick."""
    return {"train": TINY_TRAINING, "evaluate": TINY_EVALUATION}


@pytest.fixture(scope="session")
def finished(tmp_path_factory) -> Path:
    """A run that is done. Copy it before you change it."""
    path = tmp_path_factory.mktemp("cli") / "finished"
    assert main(["train", *TINY_TRAINING, f"hydra.run.dir={path}"]) == 0
    return path
