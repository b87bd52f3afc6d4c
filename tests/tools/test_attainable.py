"""The program that tells how much better than given policies anybody could do."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.cli.main import main as forcegrasp
from forcegrasp.evaluate.policies import load_policies
from tools.attainable import KNOTS_S, Grasping, _shapes, improved, main, rewards


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    path = tmp_path_factory.mktemp("robot") / "robot_6.yaml"
    assert forcegrasp(["robot", "6", f"out={path}"]) == 0
    return str(path)


@pytest.mark.parametrize("name", ["ib", "force_pi"])
def test_what_a_policy_did_can_be_played_again(robot, name):
    """Whatever rules changed its own actions; else a change of them would begin elsewhere."""
    (one,) = load_policies([name])
    grasping = Grasping(one.gripper, robot, "fast")
    grasps = grasping.grasps(5)
    episodes = grasping.episodes(one.policy, grasps, action=one.action, observation=one.observation)
    np.testing.assert_allclose(grasping.played(grasping.moved(episodes), grasps), rewards(episodes), atol=0.05)


def test_changes_earn_more_and_never_less(robot):
    grasping = Grasping(load_policies(["close"])[0].gripper, robot, "fast")
    grasps = grasping.grasps(5)
    pressing = np.full((5, grasping.config.steps, 2), -0.25)
    begun = grasping.played(pressing, grasps)
    first, second = improved(grasping, grasps, pressing, rounds=2, tries=8)
    assert (begun <= first).all()
    assert (first <= second).all()
    assert second.mean() > begun.mean() + 1


def test_changes_are_lines_between_times_after_the_touch():
    shapes = _shapes(np.array([20, 40]), 200, 0.04)
    assert shapes.shape == (2, 200, len(KNOTS_S))
    np.testing.assert_allclose(shapes.sum(axis=-1), 1)
    np.testing.assert_array_equal(shapes[0, 20], np.eye(len(KNOTS_S))[KNOTS_S.index(0.0)])
    np.testing.assert_allclose(shapes[0, :160], shapes[1, 20:180])


def test_it_tells_what_is_attainable_beside_each_policy(robot, capsys):
    main([robot, "close", "--grasps", "5", "--rounds", "1", "--tries", "4"])
    told = capsys.readouterr().out
    assert "close" in told
    assert "attainable" in told


def test_a_policy_that_is_not_there_is_told_in_one_line(robot):
    with pytest.raises(SystemExit, match=r"error: no controller, policy or run directory named 'nobody'"):
        main([robot, "nobody"])
