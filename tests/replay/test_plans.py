"""Planned grasps: commands that a gripper can follow, objects in turn, and a menu that every object meets."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.physics import default_gripper
from forcegrasp.replay.plans import MENU, OFF_CENTRE, PERIOD_S, PLANS, SAMPLES, make_command, make_plan

OPEN_M, CONTACT_M, SQUEEZE_M = 0.045, 0.025, 0.003
TIME = np.arange(SAMPLES) * PERIOD_S
RADII = np.array([0.020, 0.030, 0.033])


def plan(name: str = "rich", grasps: int = 30, radii: np.ndarray = RADII, seed: int = 0):
    return make_plan(name, radii, grasps, default_gripper(), np.random.default_rng(seed))


@pytest.mark.parametrize("kind", [*MENU, OFF_CENTRE])
@pytest.mark.parametrize("speed", [0.8, 1.0, 1.25])
def test_commands(kind, speed):
    command = make_command(kind, CONTACT_M, OPEN_M, SQUEEZE_M, speed)
    assert command.shape == (SAMPLES, 2)
    assert np.array_equal(command[:, 0], command[:, 1])
    assert command.min() >= CONTACT_M - SQUEEZE_M - 1e-12
    assert command.max() <= OPEN_M
    assert np.all(command[TIME < 0.3] == OPEN_M)  # free air first, to see what sensors read there
    deepest = 0.8 if kind == "long hold" else 1.0
    assert command.min() == pytest.approx(CONTACT_M - deepest * SQUEEZE_M, abs=2e-4)


def test_commands_go_where_the_menu_says():
    ramp = make_command("slow ramp", CONTACT_M, OPEN_M, SQUEEZE_M)[:, 0]
    assert ramp[TIME <= 0.6] == pytest.approx(OPEN_M)
    assert ramp[np.isclose(TIME, 1.0)] == pytest.approx(CONTACT_M + 0.15 * (OPEN_M - CONTACT_M))
    assert ramp[(TIME >= 3.4) & (TIME <= 4.6)] == pytest.approx(CONTACT_M - SQUEEZE_M)
    steps = make_command("fast step", CONTACT_M, OPEN_M, SQUEEZE_M)[:, 0]
    moves = np.flatnonzero(np.diff(steps))  # it jumps, and holds in between
    assert len(moves) == 4
    assert steps[(TIME > 1.6) & (TIME < 2.9)] == pytest.approx(CONTACT_M - SQUEEZE_M)
    assert steps[(TIME > 3.1) & (TIME < 4.3)] == pytest.approx(CONTACT_M - 0.4 * SQUEEZE_M)


def test_speed_stretches_what_follows_the_rest():
    at = {s: make_command("close and hold", CONTACT_M, OPEN_M, SQUEEZE_M, s)[:, 0] for s in (0.5, 1.0)}
    for later in (0.4, 1.0, 1.5):
        slow, fast = (np.interp(0.6 + later / s, TIME, command) for s, command in at.items())
        assert slow == pytest.approx(fast, abs=5e-4)


def test_commands_are_clipped_at_closed():
    command = make_command("close and hold", 0.001, OPEN_M, SQUEEZE_M)
    assert command.min() == 0


@pytest.mark.parametrize("name", PLANS)
def test_objects_in_turn(name):
    planned = plan(name)
    assert [p.object for p in planned] == [i % 3 for i in range(30)]
    for p in planned:
        radius = RADII[p.object]
        assert abs(p.offset_m) + radius < OPEN_M  # inside the open gripper
        assert abs(p.offset_m) < radius / 3
        assert radius - OPEN_M / 9 - 1e-12 <= p.command_m.min() < radius
        assert p.kind in MENU


def test_rich_plan_shows_every_object_everything():
    planned = plan()
    for thing in range(3):
        mine = [p for p in planned if p.object == thing]
        assert {p.kind for p in mine} == set(PLANS["rich"])
        offsets = np.array([p.offset_m for p in mine])
        assert 0.3 < (offsets != 0).mean() < 0.7
        assert len({p.command_m.min() for p in mine}) > 5  # depths differ


def test_offsets_go_either_way():
    offsets = [p.offset_m for p in plan()]
    assert min(offsets) < 0 < max(offsets)


def test_close_and_hold_is_always_the_same_but_for_the_object():
    planned = plan("close_and_hold")
    for p in planned:
        assert p.offset_m == 0
        assert np.array_equal(p.command_m, make_command("close and hold", RADII[p.object], OPEN_M, OPEN_M / 9))


def test_seed_decides():
    def facts(seed: int) -> list[bytes]:
        return [p.command_m.tobytes() + str(p.offset_m).encode() for p in plan(seed=seed)]

    assert facts(1) == facts(1)
    assert facts(1) != facts(2)
