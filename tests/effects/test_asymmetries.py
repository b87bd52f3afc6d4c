"""Effects of which each finger has its own share: it does what the plain effect of that size does."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from .signals import GAIN, make, settle, wave

SIDES = np.array([1.0, -1.0])
SHARES = pytest.mark.parametrize("share", [-1.0, 0.4])


@SHARES
def test_friction_asymmetry_lets_each_finger_stop_short_by_its_own(share):
    command, friction = 0.030, 0.05
    closing = settle("friction_asymmetry", (friction, share), command + 0.006, command).position[0] - command
    opening = settle("friction_asymmetry", (friction, share), command - 0.003, command).position[0] - command
    each = friction * (1 + share * SIDES)
    assert closing == pytest.approx(each / GAIN, rel=0.02, abs=2e-5)
    assert opening == pytest.approx(-each / GAIN, rel=0.02, abs=2e-5)


@SHARES
@pytest.mark.parametrize("variant", ["play", "loose"])
def test_backlash_asymmetry_leaves_each_pad_behind_by_its_own(share, variant):
    gap = 0.0006
    plant = settle("backlash_asymmetry", (gap, share), 0.0300, 0.0279, variant=variant)
    assert plant.pad_shift_m[0] == pytest.approx(gap / 2 * (1 + share * SIDES), abs=1e-6)


@SHARES
def test_backlash_asymmetry_of_commands_shifts_each_of_them(share):
    gap = 0.0006
    plant = settle("backlash_asymmetry", (gap, share), 0.0265, variant="command")
    alike = [settle("backlash", (gap * (1 + share * side),), 0.0265, variant="command") for side in SIDES]
    assert plant.position[0] == pytest.approx([one.position[0, k] for k, one in enumerate(alike)], abs=1e-9)


@SHARES
def test_compliance_asymmetry_lets_each_pad_give_by_its_own(share):
    compliance = 0.001
    plant = settle("compliance_asymmetry", (compliance, share), 0.0215)
    assert plant.pad_shift_m[0] == pytest.approx(compliance * (1 + share * SIDES) * plant.press_n[0], rel=0.01)
    assert plant.press_n.min() > 0.05


@SHARES
@pytest.mark.parametrize("variant", ["subtract", "gate"])
def test_deadzone_asymmetry_hides_of_each_reading_its_own(share, variant):
    threshold, force = 0.3, np.stack([wave(), wave(1.7)], axis=1)
    readings = make("deadzone_asymmetry", threshold, share, variant=variant).read_force(force)
    for side, reading, one in zip(SIDES, readings.T, force.T, strict=True):
        alike = make("force_deadzone", threshold * (1 + share * side), variant=variant)
        np.testing.assert_allclose(reading, alike.read_force(one[:, None])[:, 0], rtol=1e-12)


@SHARES
@pytest.mark.parametrize("at_once", [False, True])
def test_delay_asymmetry_delays_each_command_by_its_own(share, at_once):
    delay, commands, fresh = 0.0331, np.stack([wave(), wave(1.7)], axis=1)[:, None], np.ones((1000, 1), bool)

    def sent(name: str, *values: float) -> np.ndarray:
        effect = make(name, *values).attach(SimpleNamespace(position=commands[0]), np.array([0]))
        if at_once:
            return effect.commands(commands, fresh)[:, 0]
        return np.array([effect.command(*step)[0] for step in zip(commands, fresh, strict=True)])

    got = sent("delay_asymmetry", delay, share)
    for k, side in enumerate(SIDES):
        np.testing.assert_array_equal(got[:, k], sent("command_delay", delay * (1 + share * side))[:, k])
    assert np.abs(got[:, 0] - got[:, 1]).max() > 0.5


@pytest.mark.parametrize(
    ("name", "plain", "size"),
    [
        ("friction_asymmetry", "coulomb_friction", 0.05),
        ("backlash_asymmetry", "backlash", 0.0006),
        ("compliance_asymmetry", "finger_compliance", 0.001),
        ("delay_asymmetry", "command_delay", 0.05),
        ("deadzone_asymmetry", "force_deadzone", 0.1),
    ],
)
def test_with_no_share_it_is_the_plain_effect(name, plain, size):
    uneven, alike = settle(name, (size, 0.0), 0.0215), settle(plain, (size,), 0.0215)
    assert uneven.position.tobytes() == alike.position.tobytes()
    assert uneven.pad_force.tobytes() == alike.pad_force.tobytes()
