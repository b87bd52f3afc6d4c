"""A limit of time ends simulations, and nothing else."""

from __future__ import annotations

import time

import numpy as np
import pytest

from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.replay.replay import EffectOn, Replay
from forcegrasp.replay.time_limit import OutOfTimeError, check_time, lift_time_limit, time_limit
from tests.replay.test_replay import BASE, REGULAR, grasp

TIAGO = load_gripper("tiago")


@pytest.fixture
def clock(monkeypatch):
    """A clock that goes on by a minute whenever it is looked at."""
    now = iter(range(0, 100_000, 60))
    monkeypatch.setattr(time, "monotonic", lambda: next(now))


def test_time_is_over_after_as_many_minutes_as_were_given(clock):
    with time_limit(2.5):
        check_time()
        check_time()
        with pytest.raises(OutOfTimeError, match=r"2\.5 min were over before the base model was fitted"):
            check_time()
    check_time()


def test_no_limit_and_one_that_was_lifted_never_end_anything(clock):
    with time_limit(0):
        for _ in range(100):
            check_time()
    with time_limit(0.5):
        lift_time_limit()
        check_time()


@pytest.mark.parametrize("acting", [False, True])
def test_a_simulation_ends_even_while_effects_act_in_its_steps(acting, monkeypatch):
    """One of all effects on all grasps takes a minute: it must not be waited for."""
    one, ids = Replay(TIAGO, [grasp(REGULAR)]), np.array([0])
    rubs = effect_of("stiction", TIAGO)
    effects = [EffectOn(rubs, "", rubs.typical_values()[None], ids)] if acting else []
    base = {name: np.array([value]) for name, value in BASE.items()}
    one.simulate(ids, base, effects)
    looks = iter(range(1000))
    monkeypatch.setattr(time, "monotonic", lambda: 0.0 if next(looks) < (4 if acting else 1) else 61.0)
    with time_limit(1), pytest.raises(OutOfTimeError):
        one.simulate(ids, base, effects)
