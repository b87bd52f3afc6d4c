"""One model of many that diverges ends no search: its rows are far from everything, and a strict replay says so."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.errors import PhysicsError
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.target import make_target
from forcegrasp.importers.example import example_set
from forcegrasp.physics import load_gripper
from forcegrasp.replay.replay import NOWHERE, Replay

JAW = load_gripper("so101_jaw")


def silent(text: str) -> None:
    """Takes what a fit tells about its progress."""


def test_only_the_rows_that_diverged_are_nowhere():
    measured = example_set()
    grasps = make_target(measured, JAW).grasps[:2]
    base = {"position_gain": np.array([20.0, 1e9]), "damping": np.array([1.0, -1e9])}
    replay = Replay(JAW, grasps)
    motion = replay.simulate(np.arange(2), base)
    assert (motion.position[1] == NOWHERE).all()
    assert np.abs(motion.position[0]).max() < 10
    message = rf"window {grasps[1].name} diverged with position_gain=1e\+09, damping=-1e\+09; narrow"
    with pytest.raises(PhysicsError, match=message):
        Replay(JAW, grasps, strict=True).simulate(np.arange(2), base)
    assert replay.diverged.startswith(f"window {grasps[1].name} diverged")


def test_a_model_that_diverges_wherever_a_fit_goes_is_refused(monkeypatch):
    measured = example_set()
    monkeypatch.setattr("forcegrasp.replay.replay.Plant.warnings", lambda plant: np.ones((plant.n, 1), bool))
    with pytest.raises(PhysicsError, match="diverged with position_gain="):
        fit_model(Loaded(measured, JAW, []), 0, silent)
