"""Where a finger sticks and slips, slopes are taken over larger steps."""

from __future__ import annotations

import pytest

from forcegrasp.config import RecordConfig
from forcegrasp.identify.fit import Simulators
from forcegrasp.identify.initial_guess import guess
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.target import make_target
from forcegrasp.physics import load_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.replay.record import record


@pytest.mark.parametrize(("name", "step"), [("tiago", 0.02), ("so101_gripper", 0.06)])
def test_a_rough_gripper_gets_larger_steps(name, step):
    gripper = load_gripper(name)
    config = complete(RecordConfig(), gripper)
    measured = record(
        gripper, config.plan, grasps=4, objects=2, effects=[], known={}, seed=1, off_nominal=config.off_nominal,
        position_std_m=config.position_std_m, force_std_n=config.force_std_n,
    ).measured  # fmt: skip
    target = make_target(measured, gripper)
    problem = Problem(gripper, target.grasps)
    simulators = Simulators(problem)
    simulators.choose_step(target, problem, guess(target, problem))
    assert simulators.step == pytest.approx(step)
