"""Sets that can't be right: other units, other signs, other fingers, dead sensors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from measured_rig import OPEN_M, change, closing, cycles, make_grasp, make_set, standard_grasps

from forcegrasp.errors import MeasurementError
from forcegrasp.measure import FinalForceTable, check_set, check_table, read_set, write_set
from forcegrasp.measure.schema import fingerprint_of_table

MM = "looks like millimetres, divide by 1000"


def _each(**changes):
    """The same change of every grasp; each value is a function of the grasp."""
    return lambda grasps: [change(g, **{key: make(g) for key, make in changes.items()}) for g in grasps]


def _last(**changes):
    return lambda grasps: [*grasps[:-1], change(grasps[-1], **{k: make(grasps[-1]) for k, make in changes.items()})]


def _columns(values, finger, new):
    values = values.copy()
    values[:, finger] = new(values[:, finger])
    return values


def _swapped(grasp):
    return {"position_m": grasp.position_m[:, ::-1], "force_n": grasp.force_n[:, ::-1]}


def _fluctuating(grasp, size=1.0):
    noise = np.random.default_rng(5).normal(0, size, grasp.force_n.shape)
    return grasp.force_n + noise * (grasp.time_s < 0.8)[:, None]


def _put(array, index, value):
    array = np.array(array)
    array[index] = value
    return array


OPPOSITE = lambda q: OPEN_M - q  # noqa: E731
CASES = {
    "positions in mm": (_each(position_m=lambda g: 1e3 * g.position_m), [MM, "column q_l_m"]),
    "commands in mm": (_each(command_m=lambda g: 1e3 * g.command_m), [MM, "column qdes_l_m"]),
    "both in mm": (_each(position_m=lambda g: 1e3 * g.position_m, command_m=lambda g: 1e3 * g.command_m), [MM]),
    "left position in mm": (_each(position_m=lambda g: g.position_m * [1e3, 1]), [MM, "column q_l_m"]),
    "right position in mm": (_each(position_m=lambda g: g.position_m * [1, 1e3]), [MM, "column q_r_m"]),
    "right command in mm": (_each(command_m=lambda g: g.command_m * [1, 1e3]), [MM, "column qdes_r_m"]),
    "one grasp in mm": (_last(position_m=lambda g: 1e3 * g.position_m), [MM, "'g5'"]),
    "radius in mm": (_each(radius_m=lambda g: 1e3 * g.radius_m), [MM, "object_radius_m"]),
    "one radius in mm": (_last(radius_m=lambda g: 1e3 * g.radius_m), [MM, "'g5'", "object_radius_m"]),
    "masses in grams": (_each(mass_kg=lambda g: 250.0), ["grasps.csv", "'g0'", "object_mass_kg", "250", "grams"]),
    "offset in mm": (_each(offset_m=lambda g: 1e3 * g.offset_m), [MM, "object_offset_m"]),
    "object in mm": (_each(object_m=lambda g: 1e3 * g.object_m + 5), [MM, "column o_y_m"]),
    "micrometres": (_each(position_m=lambda g: 1e6 * g.position_m), ["looks like"]),
    "whole aperture": (_each(position_m=lambda g: 1.7 * g.position_m), ["out of reach", "q_l_m"]),
    "radians": (_each(position_m=lambda g: 5 * g.position_m), ["out of reach"]),
    "far beyond closed": (_each(position_m=lambda g: g.position_m - 0.05), ["out of reach"]),
    "one wild position": (
        _last(position_m=lambda g: _put(g.position_m, (7, 1), 0.3)),
        ["out of reach", "q_r_m", "t_s=0.28"],
    ),
    "milliseconds": (_each(time_s=lambda g: 1e3 * g.time_s), ["looks like milliseconds", "1000"]),
    "microseconds": (_each(time_s=lambda g: 1e6 * g.time_s), ["looks like microseconds"]),
    "nanoseconds": (_each(time_s=lambda g: 1e9 * g.time_s), ["looks like nanoseconds"]),
    "unix time in ms": (_each(time_s=lambda g: 1.7e12 + 1e3 * g.time_s), ["looks like milliseconds"]),
    "one grasp in ms": (_last(time_s=lambda g: 1e3 * g.time_s), ["looks like milliseconds", "'g5'"]),
    "row numbers for times": (_each(time_s=lambda g: 2.0 * np.arange(len(g.time_s))), ["looks like milliseconds"]),
    "time runs back": (_last(time_s=lambda g: _put(g.time_s, 9, 0.1)), ["runs back", "'g5'", "t_s"]),
    "time stands still": (_last(time_s=lambda g: _put(g.time_s, 9, g.time_s[8])), ["twice"]),
    "time in reverse": (_each(time_s=lambda g: g.time_s[::-1]), ["runs back"]),
    "NaN position": (_last(position_m=lambda g: _put(g.position_m, (3, 1), np.nan)), ["q_r_m", "nan"]),
    "infinite force": (_last(force_n=lambda g: _put(g.force_n, (3, 0), np.inf)), ["f_l_n", "inf"]),
    "NaN command": (_last(command_m=lambda g: _put(g.command_m, (0, 0), np.nan)), ["qdes_l_m"]),
    "NaN time": (_last(time_s=lambda g: _put(g.time_s, 5, np.nan)), ["t_s"]),
    "NaN object": (_last(object_m=lambda g: _put(g.object_m, 5, np.nan)), ["o_y_m"]),
    "no grasps": (lambda grasps: [], ["no grasps"]),
    "commands that never change": (_each(command_m=lambda g: 0 * g.command_m + OPEN_M), ["no command ever changes"]),
    "positions that never move": (_each(position_m=lambda g: 0 * g.position_m + 0.04), ["q_l_m", "never moves"]),
    "left encoder stuck": (_each(position_m=lambda g: g.position_m * [0, 1] + [0.02, 0]), ["q_l_m", "stuck"]),
    "right encoder stuck": (_each(position_m=lambda g: g.position_m * [1, 0]), ["q_r_m", "stuck"]),
    "encoders off but noisy": (_each(position_m=lambda g: 0.04 + 1e-3 * (g.position_m - 0.04)), ["never moves"]),
    "no forces": (_each(force_n=lambda g: 0 * g.force_n), ["all forces are zero"]),
    "left force stuck": (_each(force_n=lambda g: g.force_n * [0, 1] + [0.37, 0]), ["f_l_n", "0.37 N", "stuck"]),
    "both forces stuck": (_each(force_n=lambda g: 0 * g.force_n - 1.5), ["f_l_n", "stuck"]),
    "no contact": (
        _each(force_n=lambda g: np.random.default_rng(int(g.name[1])).normal(0, 0.013, g.force_n.shape)),
        ["no contact"],
    ),
    "no contact, bias and drift": (
        _each(force_n=lambda g: np.random.default_rng(1).normal(1, 0.013, g.force_n.shape) + 0.2 * g.time_s[:, None]),
        ["no contact"],
    ),
    "no contact, quantised": (
        _each(force_n=lambda g: 0.02 * np.round(np.random.default_rng(1).normal(0, 0.5, g.force_n.shape))),
        ["no contact"],
    ),
    "positions the wrong way": (_each(position_m=lambda g: OPPOSITE(g.position_m)), ["q_l_m", "runs against qdes_l_m"]),
    "left position the wrong way": (
        _each(position_m=lambda g: _columns(g.position_m, 0, OPPOSITE)),
        ["q_l_m", "against"],
    ),
    "right position the wrong way": (
        _each(position_m=lambda g: _columns(g.position_m, 1, OPPOSITE)),
        ["q_r_m", "against"],
    ),
    "commands and positions swapped": (
        lambda grasps: [change(g, command_m=g.position_m, position_m=g.command_m) for g in grasps],
        ["q_l_m", "moves before qdes_l_m does; are the two swapped?"],
    ),
    "commands the wrong way": (_each(command_m=lambda g: OPPOSITE(g.command_m)), ["runs against qdes_l_m"]),
    "negative positions": (_each(position_m=lambda g: -g.position_m), ["out of reach"]),
    "positions from the middle, the wrong way": (_each(position_m=lambda g: 0.04 - g.position_m), ["against"]),
    "both the wrong way": (
        _each(position_m=lambda g: OPPOSITE(g.position_m), command_m=lambda g: OPPOSITE(g.command_m)),
        ["closing direction", "q = 0 must be closed"],
    ),
    "left finger the wrong way": (
        _each(
            position_m=lambda g: _columns(g.position_m, 0, OPPOSITE),
            command_m=lambda g: _columns(g.command_m, 0, OPPOSITE),
        ),
        ["closing direction", "q_l_m"],
    ),
    "forces of 1e308": (_last(force_n=lambda g: _put(g.force_n, (3, 0), 1e308)), ["'g5'", "f_l_n: 1e+308 is no force"]),
    "forces of -1e308": (_each(force_n=lambda g: 0 * g.force_n - 1e308), ["f_l_n: -1e+308 is no force"]),
    "one force sensor twice": (_each(force_n=lambda g: g.force_n[:, [1, 1]]), ["f_l_n and f_r_n: the same readings"]),
    "one encoder twice": (_each(position_m=lambda g: g.position_m[:, [0, 0]]), ["q_l_m and q_r_m: the same readings"]),
    "forces of the wrong sign": (_each(force_n=lambda g: -g.force_n), ["f_l_n", "pressing gives negative forces"]),
    "left force of the wrong sign": (_each(force_n=lambda g: g.force_n * [-1, 1]), ["f_l_n", "negative"]),
    "right force of the wrong sign": (_each(force_n=lambda g: g.force_n * [1, -1]), ["f_r_n", "negative"]),
    "wrong sign and bias": (_each(force_n=lambda g: -g.force_n - 0.5), ["f_l_n", "negative"]),
    "wrong sign and drift": (_each(force_n=lambda g: -g.force_n + 0.05 * g.time_s[:, None]), ["f_l_n"]),
    "wrong sign on tuesday": (
        lambda grasps: [change(g, force_n=-g.force_n) if g.session == "tuesday" else g for g in grasps],
        ["negative"],
    ),
    "fingers swapped": (lambda grasps: [change(g, **_swapped(g)) for g in grasps], ["swapped", "4 of 4"]),
    "forces swapped": (_each(force_n=lambda g: g.force_n[:, ::-1]), ["swap"]),
    "offset of the wrong sign": (_each(offset_m=lambda g: -g.offset_m), ["swapped", "object_offset_m"]),
    "swapped, radius not given": (
        lambda grasps: [change(g, radius_m=None, **_swapped(g)) for g in grasps],
        ["swap"],
    ),
    "forces fluctuate in free air": (_each(force_n=_fluctuating), ["free air", "f_"]),
    "forces fluctuate in one grasp": (_last(force_n=_fluctuating), ["free air", "'g5'"]),
}
#: What can be told from a set that closes once; a rhythm hides which of two opposite ways is which.
ONLY_CLOSING = {"swapped, radius not given", "forces fluctuate in free air", "forces fluctuate in one grasp"}

#: With cycles, the forces may give the wrong way away before the commands do.
OF_THE_POSITIONS = ("q_l_m", "q_r_m", "runs against qdes_l_m", "against")


@pytest.fixture(scope="module")
def made():
    return {command: standard_grasps(command=command) for command in (closing, cycles)}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("command", [closing, cycles], ids=["close and hold", "cycles"])
@pytest.mark.parametrize("noise", [True, False], ids=["σ given", "σ unknown"])
def test_refused(made, case, command, noise):
    if command is cycles and case in ONLY_CLOSING:
        return
    spoil, parts = CASES[case]
    known = {} if noise else {"position_std_m": None, "force_std_n": None}
    with pytest.raises(MeasurementError) as caught:
        check_set(make_set(spoil(made[command]), **known), OPEN_M)
    message = str(caught.value)
    assert message.isprintable()
    assert "rig" in message
    for part in parts:
        assert part in message or (
            command is cycles and part in ("q_l_m", "q_r_m", "runs against qdes_l_m", "against")
        ), message


def _one_waits(time):
    """The left finger closes half a second before the right one, ``(T, 2)``."""
    return np.stack([closing(time), closing(time, start_s=0.9)], axis=1)


@pytest.mark.parametrize("lag_s", [0.02, 0.3])
@pytest.mark.parametrize("column", ["position_m", "command_m"])
def test_a_finger_that_follows_the_commands_of_the_other(lag_s, column):
    right = [make_grasp(i, command=_one_waits, lag_s=lag_s) for i in range(2)]
    check_set(make_set(right), OPEN_M)
    crossed = [change(g, **{column: getattr(g, column)[:, ::-1]}) for g in right]
    with pytest.raises(MeasurementError, match="column q_l_m: follows the commands of q_r_m, and that its own; swap"):
        check_set(make_set(crossed), OPEN_M)


def test_a_delay_of_half_a_period_crosses_no_fingers():
    def swinging(grasp):
        command = grasp.command_m + np.stack([0.004 * np.sin(2.5 * np.pi * grasp.time_s), 0 * grasp.time_s], axis=1)
        late = np.concatenate([np.repeat(command[:1], 10, axis=0), command[:-10]])  # 0.4 s
        return change(grasp, command_m=command, position_m=late + (grasp.position_m - grasp.command_m))

    check_set(make_set([swinging(make_grasp(i, lag_s=0.01)) for i in range(2)]), OPEN_M)


@pytest.mark.parametrize(("rows", "told"), [(0, "as it is"), (1, "1 rows earlier"), (-1, "1 rows later")])
def test_a_command_that_is_the_position(grasps, rows, told):
    copied = [change(g, command_m=np.roll(g.position_m, rows, axis=0)) for g in grasps]
    with pytest.raises(MeasurementError, match=f"column qdes_l_m: is the position itself, {told}: nothing that was"):
        check_set(make_set(copied), OPEN_M)


@pytest.mark.parametrize("shape", [(99, 2), (100, 1), (100, 3), (100,), (0, 2)])
@pytest.mark.parametrize("name", ["force_n", "position_m", "command_m"])
def test_shapes(measured, grasps, name, shape):
    spoilt = replace(measured, grasps=(change(grasps[0], **{name: np.zeros(shape)}),))
    with pytest.raises(MeasurementError, match="grasp 'g0': its signals must have one row per time stamp"):
        check_set(spoilt, OPEN_M)


def test_no_samples(measured, grasps):
    none = {name: np.zeros((0, 2)) for name in ("command_m", "position_m", "force_n")}
    spoilt = replace(measured, grasps=(change(grasps[0], time_s=np.zeros(0), object_m=None, **none),))
    with pytest.raises(MeasurementError, match="grasp 'g0': has no samples"):
        check_set(spoilt, OPEN_M)


@pytest.mark.parametrize("count", range(1, 10))
def test_too_few_samples(grasps, count):
    short = make_grasp(6, seconds=count / 25)
    with pytest.raises(MeasurementError, match=f"'g6': {count} samples are too few"):
        check_set(make_set([*grasps, short]), OPEN_M)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("position_std_m", 0.027, MM),
        ("position_std_m", 1e300, MM),
        ("force_std_n", 13.0, "force_std_n: 13 is more than the .* N from the smallest .*: looks like millinewtons"),
        ("force_std_n", 1e300, "millinewtons"),
    ],
)
def test_noise_in_another_unit(grasps, name, value, words):
    with pytest.raises(MeasurementError, match=words):
        check_set(make_set(grasps, **{name: value}), OPEN_M)


@pytest.mark.parametrize("samples", ["csv", "parquet"])
def test_file_and_row_are_named(grasps, tmp_path, samples):
    spoilt = [*grasps[:3], change(grasps[3], position_m=_put(grasps[3].position_m, (20, 1), 45.0))]
    write_set(make_set(spoilt), tmp_path / "set", samples)
    with pytest.raises(MeasurementError) as caught:
        check_set(read_set(tmp_path / "set"), OPEN_M)
    row = 3 * 100 + 20 + (2 if samples == "csv" else 1)
    assert f"samples.{samples}: grasp 'g3', row {row}, column q_r_m" in str(caught.value)


def _table(path, delta, force, objects=None):
    delta, force = np.asarray(delta, float), np.asarray(force, float)
    objects = tuple(objects or ["wood"] * len(delta))
    digest = fingerprint_of_table("tiago", None, objects, delta, force)
    return FinalForceTable(path, "t", "tiago", "me", "CC0", None, objects, delta, force, digest)


@pytest.mark.parametrize(
    ("delta", "force", "words"),
    [
        ([0.3, 0.6, 0.9], [0, 0.1, 0.2], "row 2, column delta_q_m: 0.3 where.*millimetres"),
        ([0.0003, 0.0006, 0.0009], [0, 0, 0], "all forces are zero"),
        ([0.0003, 0.0006, 0.0009], [0, -0.1, -0.2], "final_force_n: falls"),
        ([-0.0003, -0.0006, -0.0009], [0, 0.1, 0.2], "falls"),
        ([0.0003, 0.0006, 0.0009], [0, 0.1, 1e308], "row 4, column final_force_n: 1e\\+308 is no force"),
        ([0.0003, 0.0006, 0.0009], [1e308, 0, -1e308], "row 2, column final_force_n"),
    ],
)
def test_table_refused(tmp_path, delta, force, words):
    with pytest.raises(MeasurementError, match=words):
        check_table(_table(tmp_path, delta, force), OPEN_M)


@pytest.mark.parametrize("std", [13.0, 1e300])
def test_noise_of_a_table_in_another_unit(tmp_path, std):
    table = replace(_table(tmp_path, [0.0003, 0.0006, 0.0009], [0, 0.1, 0.2]), force_std_n=std)
    with pytest.raises(MeasurementError, match=r"meta.yaml: force_std_n: .*the 0.2 N .*looks like millinewtons"):
        check_table(table, OPEN_M)


def test_table_of_the_paper(root_table, tmp_path):
    delta, force, objects = root_table
    assert check_table(_table(tmp_path, delta, force, objects), OPEN_M) == []
    assert "2 rows only" in check_table(_table(tmp_path, delta[:2], force[:2]), OPEN_M)[0]


@pytest.fixture
def root_table():
    delta = [0.0003 * i for i in range(1, 11)] * 2
    sponge = [0.0, 0.1, 0.15, 0.32, 0.37, 0.47, 0.54, 0.6, 0.63, 0.81]
    wood = [0.0, 0.13, 0.24, 0.36, 0.47, 0.54, 0.62, 0.75, 0.83, 0.9]
    return delta, sponge + wood, ["sponge"] * 10 + ["wood"] * 10
