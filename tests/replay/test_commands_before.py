"""What was commanded before a window is known: effects whose memory is of commands alone begin with it."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.effects import Effect
from forcegrasp.effects.for_gripper import effect_of, effects_of
from forcegrasp.measure.schema import MeasuredGrasp, columns_of
from forcegrasp.physics import load_gripper
from forcegrasp.physics.plant import Plant
from forcegrasp.replay.replay import EffectOn, Replay

JAW = load_gripper("so101_jaw")
ROWS = np.arange(2)
KNOWN = [(e, v) for e in effects_of(JAW).values() for v in e.known_beforehand if v in e.variants]


def attached(dt: float, *effects: tuple[type[Effect], str]) -> Plant:
    plant = Plant(JAW, 2)
    plant.attach([(e(np.tile(e.typical_values(), (2, 1)), dt, variant), ROWS) for e, variant in effects])
    plant.reset(ROWS, np.zeros(2), np.zeros((2, 1)))
    return plant


@pytest.mark.parametrize("effects", [*((one,) for one in KNOWN), tuple(KNOWN[:3])], ids=str)
def test_what_is_recalled_is_what_was_seen(effects):
    dt = 0.02
    commands = np.cumsum(np.random.default_rng(0).normal(0, 0.02, (2, 200, 1)), axis=1)
    fresh = np.tile(np.arange(200) % 9 == 0, (2, 1))
    whole = attached(dt, *effects).effects.commands(commands, fresh)
    later = attached(dt, *effects).effects
    later.recall(commands[:, :120], fresh[:, :120])
    assert later.commands(commands[:, 120:], fresh[:, 120:]).tobytes() == whole[:, 120:].tobytes()


def window(before: tuple[np.ndarray, np.ndarray] | None) -> MeasuredGrasp:
    time, there = np.arange(20) * 0.02, np.zeros((20, 1))
    return MeasuredGrasp(
        "one", "", "one", None, None, None, time, there + 0.5, there, np.empty((20, 0)), None,
        columns=columns_of(JAW), start=(np.zeros(1), np.zeros(1)), before=before,
    )  # fmt: skip


def test_a_command_on_its_way_when_a_window_begins_arrives_in_it():
    times = np.arange(-10, 0) * 0.02
    earlier = times, np.where(times < -0.05, 0.0, 0.5)[:, None]
    late = effect_of("command_delay", JAW)
    delay = EffectOn(late, "", np.full((3, 1), 0.1), np.arange(3))
    # the last row's commands before are unknown: it is taken to have rested
    motion = Replay(JAW, [window(earlier), window((times[:0], np.empty((0, 1)))), window(None)])
    moved = motion.simulate(np.arange(3), {}, [delay]).position[:, :, 0] > 1e-4
    first = moved.argmax(axis=1) * motion.dt
    np.testing.assert_allclose(first, [0.06, 0.1, 0.1], atol=0.008)
