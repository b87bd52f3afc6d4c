"""Whatever policy and sensors say, commands stay within the limits; and a step that can't be trusted holds."""

from __future__ import annotations

import dataclasses
import logging
import math

import numpy as np
import pytest

from forcegrasp.deploy import GraspController
from forcegrasp.errors import DeployError

NAN, INF = math.nan, math.inf
PERIOD = 0.04
OPEN, PRESSING = [0.04, 0.04], [0.02, 0.021]


class Scripted:
    """Acts as told, and remembers what it saw."""

    def __init__(self, *actions) -> None:
        self.actions, self.seen = list(actions), []

    def reset(self) -> None:
        self.seen = []

    def act(self, parts):
        self.seen.append(parts)
        return np.array(self.actions[min(len(self.seen), len(self.actions)) - 1])


def controller(*actions, goal: float = 0.5, gripper: str = "tiago", **contract) -> GraspController:
    own = GraspController.baseline(gripper=gripper).contract
    contract = dataclasses.replace(own, **({"inductive_bias": True} | contract))
    made = GraspController(Scripted(*actions or ([-1.0, -1.0],)), contract)
    made.reset(goal)
    return made


@pytest.mark.parametrize("seed", range(5))
def test_limits_hold_for_a_hostile_policy_and_wild_readings(seed):
    rng = np.random.default_rng(seed)
    wild = [NAN, INF, -INF, 1e30, -1e30, 0.0, 2.0, -2.0, 0.5, -0.5, 1e-3]
    made = controller(*rng.choice(wild, (600, 2)), inductive_bias=bool(seed % 2), ceiling_n=1.0)
    made.step(OPEN, [0.0, 0.0], 0.0)
    before, t, holds = made.step(OPEN, [0.0, 0.0], PERIOD), PERIOD, 0
    for _ in range(600):
        q, f = rng.uniform(0, 0.045, 2), rng.uniform(-0.05, 1.5, 2)
        if rng.random() < 0.2:
            (q if rng.random() < 0.5 else f)[rng.integers(2)] = rng.choice([NAN, INF, -INF, 1e3, -1e3])
        t += 0.3 if rng.random() < 0.05 else PERIOD
        command = made.step(q, f, t - (1.0 if rng.random() < 0.05 else 0.0))
        assert np.isfinite(command).all()
        assert ((command >= 0) & (command <= 0.045)).all()
        if made.fault is None or "ceiling" in made.fault:
            assert (np.abs(command - q) <= 0.003 + 1e-9).all()
            if f.max() > 1.0:
                assert "ceiling" in made.fault
                assert (command >= q).all()
        else:
            assert (command == before).all()
            holds += 1
        before = command
    assert 50 < holds < 550


BAD = {
    "position NaN": (([0.03, NAN], [0.1, 0.1]), "position reading is not finite: [0.03, nan] m"),
    "force infinite": (([0.03, 0.03], [INF, 0.1]), "force reading is not finite: [inf, 0.1] N"),
    "position beyond the joint": (([0.03, 0.06], [0.1, 0.1]), "position reading can't be true: [0.03, 0.06]"),
    "millimetres": (([30.0, 30.0], [0.1, 0.1]), "position reading can't be true"),
    "force too large": (([0.03, 0.03], [0.1, 21.0]), "force reading can't be true: [0.1, 21] is not in [-1, 20] N"),
    "force too negative": (([0.03, 0.03], [-1.5, 0.1]), "force reading can't be true"),
    "no reading": ((None, [0.1, 0.1]), "position reading does not fit: tiago needs 2 positions and 2 forces; holding"),
    "three readings": (
        ([0.03, 0.03], [0.1, 0.1, 0.1]),
        "force reading does not fit: tiago needs 2 positions and 2 forces",
    ),
    "text": ((["a", "b"], [0.1, 0.1]), "position reading does not fit"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_reading_is_held_and_said_and_control_goes_on_as_if_it_had_not_been(name, caplog):
    reading, told = BAD[name]
    disturbed, undisturbed = controller(), controller()
    for one in (disturbed, undisturbed):
        one.step(OPEN, [0.0, 0.0], 0.0)
        last = one.step(PRESSING, [0.2, 0.2], PERIOD)
    with caplog.at_level(logging.WARNING, "forcegrasp.deploy"):
        for _ in range(3):
            assert (disturbed.step(*reading, 1.5 * PERIOD) == last).all()
            assert told in disturbed.fault
            assert "\n" not in disturbed.fault
    assert [record.levelname for record in caplog.records] == ["WARNING"]  # once
    assert told in caplog.text
    after = [one.step(PRESSING, [0.3, 0.3], 2 * PERIOD) for one in (disturbed, undisturbed)]
    assert (after[0] == after[1]).all()
    assert disturbed.fault is None
    assert len(disturbed.policy.seen) == len(undisturbed.policy.seen) == 3
    assert all((disturbed.policy.seen[-1][part] == seen).all() for part, seen in undisturbed.policy.seen[-1].items())


@pytest.mark.parametrize(
    ("t", "told"),
    [
        (PERIOD, "stale: its time 0.040 s is not after 0.040 s"),
        (0.01, "stale"),
        (PERIOD + 0.005, "too soon: 0.005 s after the last one, not 0.04 s"),
        (PERIOD + 0.11, "gap: 0.110 s, more than 0.1 s"),
        (1e9, "gap"),
        (NAN, "not finite"),
        (INF, "not finite"),
    ],
)
def test_time_of_a_reading(t, told):
    made = controller()
    made.step(OPEN, [0.0, 0.0], 0.0)
    last = made.step(PRESSING, [0.2, 0.2], PERIOD)
    assert (made.step(OPEN, [0.2, 0.2], t) == last).all()
    assert told in made.fault
    # after a gap the clock goes on from the late reading, after all else from the last good one
    made.step(OPEN, [0.2, 0.2], (t if "gap" in told else PERIOD) + PERIOD)
    assert made.fault is None


def test_long_outage_of_a_sensor_is_a_gap():
    made = controller()
    made.step(OPEN, [0.0, 0.0], 0.0)
    for k in range(1, 10):
        made.step(OPEN, [NAN, 0.0], k * PERIOD)
    made.step(OPEN, [0.0, 0.0], 10 * PERIOD)
    assert "gap" in made.fault
    made.step(OPEN, [0.0, 0.0], 11 * PERIOD)
    assert made.fault is None


def test_without_times_nothing_is_stale():
    made = controller()
    for _ in range(3):
        made.step(OPEN, [0.0, 0.0])
        assert made.fault is None


@pytest.mark.parametrize("bad", [[NAN, 0.0], [0.0, INF], [-INF, NAN]])
def test_action_that_is_not_finite_is_held(bad):
    made = controller([-1.0, -0.5], bad, [0.25, 0.5])
    last = made.step(OPEN, [0.0, 0.0])
    assert (made.step([0.038, 0.038], [0.0, 0.0]) == last).all()
    assert "action is not finite" in made.fault
    assert (made.action == [-1.0, -0.5]).all()  # which is what the policy sees as its last one
    made.step([0.038, 0.038], [0.0, 0.0])
    assert made.fault is None
    assert (made.policy.seen[-1]["last_action"] == np.float32([-1.0, -0.5])).all()


@pytest.mark.parametrize("forces", [[2.1, 0.3], [0.3, 2.1], [2.1, 2.5]])
def test_above_the_ceiling_no_finger_closes_but_may_open(forces):
    made = controller([-1.0, 1.0], inductive_bias=False)
    assert made.step(PRESSING, forces) == pytest.approx([0.02, 0.024])
    assert made.fault.startswith("force is above the ceiling of 2 N")
    assert made.step(PRESSING, [1.9, 1.9]) == pytest.approx([0.017, 0.024])
    assert made.fault is None


def test_ceiling_can_be_set(exported):
    for made in (GraspController.load(exported, ceiling_n=0.6), GraspController.baseline(ceiling_n=0.6)):
        made.reset(0.5)
        made.step(PRESSING, [0.7, 0.7])
        assert "ceiling of 0.6 N" in made.fault
        for wrong in (0.0, -1.0, NAN, INF, 50.0):
            with pytest.raises(ValueError, match="ceiling_n"):
                GraspController.baseline(ceiling_n=wrong)


@pytest.mark.parametrize("goal", [0.0, 0.05, 1.5, -1.0, NAN, INF])
def test_goal_that_was_not_trained_is_refused(goal):
    made = controller(goal=0.3)
    with pytest.raises(ValueError, match=r"must lie in \[0.08, 1.425\] N, which was trained") as caught:
        made.reset(goal)
    assert "\n" not in str(caught.value)
    assert made.goal_n == 0.3  # as before


def test_goal_above_the_ceiling_is_refused():
    with pytest.raises(ValueError, match=r"not above the ceiling of 0\.7 N"):
        controller(goal=0.8, ceiling_n=0.7)


def test_before_the_first_good_reading():
    made = GraspController.baseline()
    with pytest.raises(RuntimeError, match="call reset"):
        made.step(OPEN, [0.0, 0.0])
    made.reset(0.5)
    with pytest.raises(DeployError, match=r"position reading is not finite.*nothing to hold"):
        made.step([NAN, 0.03], [0.0, 0.0])
    with pytest.raises(DeployError, match="nothing to hold"):
        made.step(None, None)
    # where the fingers stand is known, so they stay there
    assert (made.step([0.03, 0.031], [NAN, 0.0]) == [0.03, 0.031]).all()
    assert "force reading" in made.fault
    assert made.step([0.03, 0.031], [0.0, 0.0]) == pytest.approx([0.027, 0.028])


def test_reset_forgets():
    made = controller([-1.0, -1.0])
    made.step(OPEN, [0.3, 0.3], 100.0)
    made.step([0.0, 0.0], [0.3, 0.3], 100.04)
    made.step([0.0, 0.0], [NAN, 0.3], 100.08)
    made.reset(0.6)
    assert made.fault is None
    assert made.step(OPEN, [0.3, 0.3], 0.0) == pytest.approx([0.037, 0.037])  # a clock may start anew, too
    seen = made.policy.seen[-1]
    assert (seen["had_contact"] == 0).all()
    assert (seen["last_action"] == 0).all()
    assert seen["force_error"] == pytest.approx([0.3, 0.3])


def test_command_is_the_callers_own():
    made = controller()
    command = made.step(OPEN, [0.0, 0.0])
    command[:] = 0.0
    assert made.step(OPEN, [NAN, 0.0]) == pytest.approx([0.037, 0.037])


def test_readings_of_another_gripper_are_refused_by_their_numbers():
    made = GraspController.baseline(gripper="franka_hand")
    made.reset(1.0)
    with pytest.raises(DeployError, match="position reading does not fit: franka_hand needs 1 position and 2 forces"):
        made.step([0.03, 0.03], [0.0, 0.0])
    assert made.step(0.03, [0.0, 0.0]) == pytest.approx([0.028])  # of one motor, the number may come alone
    made.step(0.03, 0.0)
    assert made.fault.startswith("force reading does not fit: franka_hand needs 1 position and 2 forces")


def test_action_of_another_gripper_is_not_commanded():
    made = controller([-1.0, -1.0], gripper="franka_hand", goal=1.0)
    assert (made.step([0.03], [0.0, 0.0]) == [0.03]).all()
    assert made.fault == "action does not fit: [-1, -1], not one per motor; holding"


@pytest.mark.parametrize("forces", [[7.0, 0.3], [0.3, 7.0]])
def test_above_the_ceiling_the_one_motor_does_not_close(forces):
    made = controller([-1.0], [1.0], gripper="franka_hand", goal=1.0)
    assert made.step(0.03, forces) == pytest.approx([0.03])
    assert made.fault.startswith("force is above the ceiling of 6.667 N")
    assert made.step(0.03, forces)[0] > 0.03


def test_units_of_a_hinge():
    made = controller([-1.0], gripper="so101_gripper", goal=1.0)
    made.step(0.8, 0.0)
    made.step(1.0, 0.0)
    assert made.fault == "position reading can't be true: [1] is not in [-0.03556, 0.8356] rad; holding"
    made.step(0.8, -40.0)  # an effort that opens
    assert made.fault is None


def test_effort_of_a_motor_that_moves_is_no_contact():
    made = controller([-1.0], gripper="so101_gripper", goal=1.0)
    for position, force, contact in ((0.8, 2.0, 0), (0.79, 2.0, 0), (0.7885, 0.3, 0), (0.788, 2.0, 1), (0.77, 0.0, 1)):
        made.step(position, force)
        assert made.policy.seen[-1]["had_contact"] == [contact]
