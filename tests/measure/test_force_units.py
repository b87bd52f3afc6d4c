"""Forces that are no newtons: of one channel in all grasps, or in a few."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from measured_rig import change, make_grasp, make_set

from forcegrasp.measure.force_units import OddUnit, check_force_units, find_odd_unit


def pressed(*numbers: int, factor=1.0, channel: int = 1, offset_m: float = 0.0):
    """Twelve grasps; in those of these numbers a channel reads so many times what it should."""
    grasps = [make_grasp(i, offset=offset_m * (-1) ** i) for i in range(12)]
    units = np.where(np.arange(2) == channel, factor, 1.0)
    return make_set([change(g, force_n=g.force_n * units) if i in numbers else g for i, g in enumerate(grasps)])


@pytest.mark.parametrize(("channel", "factor"), [(1, 1000.0), (0, 0.102), (1, 9.81)])
def test_channels_in_different_units(channel, factor):
    (warning,) = check_force_units(pressed(*range(12), factor=factor, channel=channel))
    assert "are both in newtons?" in warning
    assert f"column f_{'lr'[channel if factor > 1 else 1 - channel]}_n: reads " in warning


def test_channels_that_differ_by_their_gain_are_not_doubted():
    assert check_force_units(pressed(*range(12), factor=2.0)) == []


@pytest.mark.parametrize(
    ("channel", "factor", "told"), [(1, 10.0, 10.0), (0, 9.80665, 10.0), (0, 1e-3, 1e-3), (1, 4.4, 4.44822)]
)
def test_a_channel_in_another_unit_in_a_few_grasps(channel, factor, told):
    measured = pressed(1, 4, 7, 10, factor=factor, channel=channel)
    found = find_odd_unit(measured)
    assert found is not None
    assert (found.channel, found.grasps) == (channel, (1, 4, 7, 10))
    assert found.factor == pytest.approx(told)
    (warning,) = check_force_units(measured)
    names = [measured.grasps[i].name for i in (1, 4, 7, 10)]
    assert f"column f_{'lr'[channel]}_n: reads about {told:.3g} times in {', '.join(names)} what" in warning
    right = found.put_right(measured.grasps[4])
    np.testing.assert_allclose(
        right.force_n * np.where(np.arange(2) == channel, found.factor, 1.0), measured.grasps[4].force_n
    )


@pytest.mark.parametrize(
    "measured",
    [
        pressed(),
        pressed(1, 4, factor=10.0),  # two may have been pressed so
        pressed(1, 4, 7, 10, factor=2.0),  # a gain is no unit
        pressed(1, 4, 7, 10, factor=25.0),  # nor is what no unit is
        pressed(*range(6), factor=10.0),  # of half of them nothing tells which are right
        pressed(offset_m=0.006),  # one finger presses more than the other
    ],
)  # fmt: skip
def test_what_is_no_other_unit(measured):
    assert find_odd_unit(measured) is None


def test_a_grasp_that_presses_with_one_finger_is_not_among_them():
    """There the other one reads a tenth, and this one what it does in other grasps."""
    measured = pressed(1, 4, 7, factor=10.0)
    grasps = [change(g, force_n=g.force_n * [0.1, 1.0]) if i in (2, 5) else g for i, g in enumerate(measured.grasps)]
    assert find_odd_unit(make_set(grasps)) == OddUnit(1, 10.0, (1, 4, 7))


def test_one_channel_tells_nothing():
    one = SimpleNamespace(columns=SimpleNamespace(force=("f_l_n",), read_effort=False), grasps=())
    assert find_odd_unit(one) is None
    assert check_force_units(one) == []
