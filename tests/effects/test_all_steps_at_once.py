"""What effects do to many steps at once is what they do step by step, bit for bit, whatever came before."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.effects import Effect, catalogue

ROWS, STEPS, DT = 3, 60, 0.002
AT_ONCE = ("commands", "read_forces", "read_positions")
OVERRIDDEN = [
    (effect, hook)
    for effect in catalogue().values()
    for hook in AT_ONCE
    if getattr(effect, hook) is not getattr(Effect, hook)
]


class Delayed:
    """Stands for the plant of an effect that asks it for nothing but where the motors are at the start."""

    position = np.full((ROWS, 2), 0.03)
    recorded_position = None


def test_some_do():
    by_time = {"command_delay", "delay_asymmetry", "force_delay", "readout_skew"}
    assert {effect.name for effect, _ in OVERRIDDEN} == by_time


@pytest.mark.parametrize("seen_before", [0, 1, 25])
@pytest.mark.parametrize(("effect", "hook"), OVERRIDDEN, ids=lambda value: getattr(value, "name", value))
def test_they_are_those_of_step_by_step(effect, hook, seen_before):
    rng = np.random.default_rng(seen_before)
    signals, fresh = rng.normal(size=(STEPS, ROWS, 2)), np.ones((STEPS, ROWS), bool)
    more = (fresh,) if hook == "commands" else ()
    times, others = np.array([[0.0], [0.0073], [0.02]]), np.tile(effect.typical_values()[1:], (ROWS, 1))
    made = []
    for of in (effect, Effect):
        one = effect(np.hstack([times, others]), DT).attach(Delayed(), np.arange(ROWS))
        step = {"commands": one.command, "read_forces": one.read_force, "read_positions": one.read_position}[hook]
        for signal in signals[:seen_before]:
            step(signal, *(known[0] for known in more))
        made.append(getattr(of, hook)(one, signals[seen_before:], *(known[seen_before:] for known in more)))
    assert made[0].tobytes() == made[1].tobytes()
    assert (made[0][:, 0] == signals[seen_before:, 0]).all()
    assert not np.array_equal(made[0][:, 1], signals[seen_before:, 1])
