"""What half a physics step changes is the simulation's error, but where a drive takes steps of its own."""

from __future__ import annotations

import pytest

from forcegrasp.identify import noise_floor
from forcegrasp.identify.problem import Problem
from forcegrasp.physics import load_gripper
from forcegrasp.replay.replay import Replay
from tests.made_up import fit_of


@pytest.mark.parametrize(("mechanism", "halved"), [("emps", 1.0), ("so101_jaw", 0.5)])
def test_a_scene_that_steps_at_the_control_period_is_not_halved(mechanism, halved, monkeypatch, made_up):
    asked: list[float] = []

    class Seen(Replay):
        def __init__(self, gripper, grasps, step_factor=1.0, **more) -> None:
            asked.append(step_factor)

    monkeypatch.setattr(noise_floor, "Replay", Seen)
    monkeypatch.setattr(noise_floor, "predict", lambda *_: made_up.base.fit.predicted[None])
    problem = Problem(load_gripper(mechanism), ())
    fit = fit_of(problem, made_up.target, made_up.base.fit.residual)
    noise_floor.numerical_error(fit, made_up.target)
    assert asked == [halved, 1.0]
