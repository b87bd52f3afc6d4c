"""What happened before a window is known: effects whose memory is of commands or of motion alone begin with it."""

from __future__ import annotations

import dataclasses

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
    later = attached(dt, *effects)
    later.recall(commands[:, :120], fresh[:, :120], np.zeros((2, 120, 1)), ROWS)
    assert later.effects.commands(commands[:, 120:], fresh[:, 120:]).tobytes() == whole[:, 120:].tobytes()


FOLLOWING = [
    (e, v) for e in effects_of(JAW).values() if e.follows_motion for v in e.variants if v not in e.known_beforehand
]


@pytest.mark.parametrize("steps", [2, 200])  # a short one still remembers where it began
@pytest.mark.parametrize("effect", FOLLOWING, ids=str)
def test_motion_that_is_recalled_is_motion_that_was_made(effect, steps):
    made, recalled = attached(0.02, effect), attached(0.02, effect)
    path = 0.3 + np.cumsum(np.random.default_rng(0).normal(0, 0.01, (2, steps, 1)), axis=1)
    made.position = path[:, 0]
    made.effects.reset(ROWS)
    for step in range(steps):
        made.position = path[:, step]
        made.effects.contribute(made._contributed)
    recalled.recall(path, np.ones((2, steps), bool), path, ROWS)
    assert not recalled.position.any()  # it stands where it stood
    (one,), (other,) = made.effects, recalled.effects
    assert {name: values.tolist() for name, values in one.state.items()} == {
        name: values.tolist() for name, values in other.state.items()
    }


def window(before: tuple[np.ndarray, np.ndarray, np.ndarray] | None) -> MeasuredGrasp:
    time, there = np.arange(20) * 0.02, np.zeros((20, 1))
    return MeasuredGrasp(
        "one", "", "one", None, None, None, time, there + 0.5, there, np.empty((20, 0)), None,
        columns=columns_of(JAW), start=(np.zeros(1), np.zeros(1)), before=before,
    )  # fmt: skip


def test_a_command_on_its_way_when_a_window_begins_arrives_in_it():
    times = np.arange(-10, 0) * 0.02
    earlier = times, np.where(times < -0.05, 0.0, 0.5)[:, None], np.zeros((10, 1))
    late = effect_of("command_delay", JAW)
    delay = EffectOn(late, "", np.full((3, 1), 0.1), np.arange(3))
    # the last row's commands before are unknown: it is taken to have rested
    motion = Replay(JAW, [window(earlier), window((times[:0], np.empty((0, 1)), np.empty((0, 1)))), window(None)])
    moved = motion.simulate(np.arange(3), {}, [delay]).position[:, :, 0] > 1e-4
    first = moved.argmax(axis=1) * motion.dt
    np.testing.assert_allclose(first, [0.06, 0.1, 0.1], atol=0.008)


def test_bristles_are_bent_as_they_were_before_a_window():
    times = np.arange(-10, 0) * 0.02
    still = np.zeros((10, 1))
    back = times, still, np.linspace(-0.5, 0.0, 10)[:, None]  # it came from there, and the bristles push it back
    bristles = EffectOn(effect_of("presliding", JAW), "", np.tile([0.1, 0.02], (2, 1)), np.arange(2))
    held = [dataclasses.replace(window(before), command_m=np.zeros((20, 1))) for before in (back, None)]
    moved = Replay(JAW, held).simulate(np.arange(2), {}, [bristles]).position[:, :, 0]
    assert moved[0].min() < -1e-4
    assert not moved[1].any()


def test_samples_may_be_nearer_to_each_other_than_steps():
    jaw = Replay(JAW, [window(None)])
    times = np.arange(-40, 0) * jaw.dt / 4
    earlier = times, np.full((40, 1), 0.5), np.zeros((40, 1))
    delay = EffectOn(effect_of("command_delay", JAW), "", np.full((1, 1), 4 * jaw.dt), np.arange(1))
    at_once = EffectOn(effect_of("command_delay", JAW), "", np.zeros((1, 1)), np.arange(1))
    recalled = Replay(JAW, [window(earlier)])
    late, plain = (recalled.simulate(np.arange(1), {}, [one]).position for one in (delay, at_once))
    assert late.tobytes() == plain.tobytes()  # all that was on its way had been commanded before
