"""Tasks side by side get what they would get alone, by fewer simulations; and none is left behind."""

from __future__ import annotations

import threading
from functools import cache, partial

import numpy as np
import pytest

from forcegrasp.effects import get_effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.errors import PhysicsError
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.predict import predict
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.side_by_side import side_by_side
from forcegrasp.measure import MeasurementSet
from forcegrasp.replay.replay import Replay
from tests.light_set import light_set


@pytest.fixture
def counted(monkeypatch) -> list[int]:
    """How many rows each simulation had."""
    grasps()
    rows, simulate = [], Replay.simulate

    def counting(self, grasp, *args, **options):
        rows.append(len(grasp))
        return simulate(self, grasp, *args, **options)

    monkeypatch.setattr(Replay, "simulate", counting)
    return rows


@cache
def grasps() -> Loaded[MeasurementSet]:
    """Three short ones."""
    return light_set(samples=20, grasps=3)


def replayed() -> Replay:
    """A simulator of their grasps."""
    loaded = grasps()
    return Replay(loaded.gripper, loaded.measured.grasps)


def follow(replay: Replay, name: str, sizes: list[float]) -> list[np.ndarray]:
    """Signals with an effect of these sizes, asked for one after the other."""
    signals = []
    for size in sizes:
        setting = EffectSetting.typical(get_effect(name))
        problem = Problem(replay.gripper, replay.grasps, [setting])
        start = problem.start()
        start[-len(setting.values)] *= size
        signals.append(predict(replay, [problem.case(start)])[0])
    return signals


TASKS = (("coulomb_friction", [1.0, 0.5]), ("command_delay", [1.0, 0.7, 0.2]), ("backlash", [0.5]))


def test_each_gets_what_it_would_get_alone_by_fewer_simulations(counted):
    alone = [follow(replayed(), name, sizes) for name, sizes in TASKS]
    assert counted == [3] * 6
    counted.clear()
    replay = replayed()
    together = side_by_side([partial(follow, replay, name, sizes) for name, sizes in TASKS])
    assert counted == [9, 6, 3]
    for ours, theirs in zip(together, alone, strict=True):
        assert all(map(np.array_equal, ours, theirs))


def test_of_two_simulators_the_one_that_more_wait_for_comes_first(counted):
    one, other = replayed(), replayed()

    def task(*replays: Replay) -> None:
        for k, replay in enumerate(replays):
            follow(replay, "coulomb_friction", [1.0 + k])

    side_by_side([partial(task, other), partial(task, one, other), partial(task, one, other)])
    assert counted == [3, 6]  # two ask one for the same, and the first waits until they ask the other, too


def test_tasks_may_have_tasks_of_their_own(counted):
    replay = replayed()

    def outer(name: str) -> list[list[np.ndarray]]:
        return side_by_side([partial(follow, replay, name, [size]) for size in (1.0, 2.0)])

    found = side_by_side([partial(outer, "coulomb_friction"), partial(outer, "stiction")])
    assert counted == [12]
    np.testing.assert_array_equal(found[1][1], follow(replayed(), "stiction", [2.0]))


def test_an_error_of_one_is_raised_once_all_have_ended(counted):
    replay, ended = replayed(), []

    def fails() -> None:
        follow(replay, "coulomb_friction", [1.0])
        raise PhysicsError("diverged")

    def ends() -> None:
        follow(replay, "stiction", [1.0, 0.5])
        ended.append(True)

    with pytest.raises(PhysicsError, match="diverged"):
        side_by_side([fails, ends])
    assert ended == [True]


def test_what_stops_a_simulation_leaves_no_thread_behind(monkeypatch):
    def interrupted(*args, **options):
        raise KeyboardInterrupt

    before, replay = threading.active_count(), replayed()
    monkeypatch.setattr(Replay, "simulate", interrupted)
    with pytest.raises(KeyboardInterrupt):
        side_by_side([partial(follow, replay, name, sizes) for name, sizes in TASKS])
    assert threading.active_count() == before


def test_one_task_runs_where_it_is():
    assert side_by_side([threading.current_thread]) == [threading.current_thread()]
    assert side_by_side([]) == []
