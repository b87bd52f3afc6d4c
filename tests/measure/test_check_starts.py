"""A grasp whose fingers press as it begins is told: the model's fingers start at rest, and free."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from measured_rig import OPEN_M, change, make_set, standard_grasps

from forcegrasp.measure import check_set
from forcegrasp.measure.schema import MeasuredGrasp


def told(grasps: list[MeasuredGrasp]) -> list[str]:
    return [line for line in check_set(make_set(grasps), OPEN_M) if "begins with" in line]


def without_start(grasp: MeasuredGrasp, seconds: float = 2.0) -> MeasuredGrasp:
    """What is left of a log that was begun too late."""
    late = grasp.time_s >= seconds
    rows = {"time_s", "command_m", "position_m", "force_n", "object_m"}
    return change(grasp, **{name: getattr(grasp, name)[late] for name in rows})


@pytest.mark.parametrize(("late", "words"), [(1, "begin a grasp's log"), (3, "as 2 more do")])
def test_grasps_that_begin_pressed_are_told_once_with_where_and_how_much(late, words):
    grasps = standard_grasps()
    (line,) = told([without_start(g) if i < late else g for i, g in enumerate(grasps)])
    assert "grasp 'g0', t_s=2, column f_" in line
    assert words in line
    pressed = grasps[0].force_n[grasps[0].time_s >= 2.0][:5].max()
    assert float(line.split("begins with ")[1].split(" N")[0]) == pytest.approx(pressed, rel=0.05)


def test_a_zero_that_is_off_in_free_air_is_not_told():
    assert told(standard_grasps()) == []
    assert told([change(g, force_n=g.force_n + np.array([1.5, 0.0])) for g in standard_grasps()]) == []


def test_one_sensor_is_enough_and_none_tells_nothing():
    late = [without_start(g) if i < 3 else g for i, g in enumerate(standard_grasps())]
    for channels in (1, 0):
        columns = dataclasses.replace(late[0].columns, force=late[0].columns.force[:channels])
        grasps = [change(g, columns=columns, force_n=g.force_n[:, :channels]) for g in late]
        lines = check_set(make_set(grasps), OPEN_M, pads_at=np.asarray)
        assert len([line for line in lines if "begins with" in line]) == channels


def test_fingers_that_wait_close_to_an_object_are_not_told():
    """They stand where they will touch next, and press nothing yet."""
    rows, noise = 15, 0.013 * np.random.default_rng(0).standard_normal((15, 2))
    grasps = standard_grasps()
    for index, g in enumerate(grasps):
        late = without_start(g, 1.4)
        assert g.radius_m is not None
        assert g.object_m is not None
        waiting = np.full((rows, 2), g.radius_m + 3e-4)
        before = {"command_m": waiting, "position_m": waiting, "force_n": noise, "object_m": g.object_m[:rows]}
        both = {name: np.concatenate([rest, getattr(late, name)]) for name, rest in before.items()}
        grasps[index] = change(late, time_s=np.arange(len(both["force_n"])) * 0.04, **both)
    assert told(grasps) == []
