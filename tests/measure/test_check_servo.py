"""What can't be right of a servo's log is told before anything is fitted, and what a servo may do is not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.errors import MeasurementError
from forcegrasp.importers.example import example_set
from forcegrasp.measure import check_servo
from forcegrasp.measure.check_commands import refuse_swapped
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet, columns_of
from forcegrasp.physics import load_gripper

EXAMPLE = example_set()
SINE = next(one for one in EXAMPLE.grasps if one.name == "sine")
COLUMNS = columns_of(load_gripper("so101_jaw"))
DEGREES = 180 / np.pi


def checked(*recordings: MeasuredGrasp, span: float = 1.0) -> list[str]:
    return check_servo(dataclasses.replace(EXAMPLE, grasps=recordings), [span])


def changed(one: MeasuredGrasp = SINE, **changes) -> MeasuredGrasp:
    return dataclasses.replace(one, **changes)


def of(command: np.ndarray, position: np.ndarray, **more) -> MeasuredGrasp:
    """A recording of a hinge at 50 Hz."""
    time = np.arange(len(command)) * 0.02
    nothing = np.empty((len(time), 0))
    return changed(time_s=time, command_m=command[:, None], position_m=position[:, None], force_n=nothing, **more)


TIME = np.arange(400) * 0.02
NOISE = 0.0004 * np.random.default_rng(0).standard_normal((2, 400))
RIGHT = {
    "holds, then one step": of(np.where(TIME < 4, 0.2, 0.7), np.where(TIME < 4.1, 0.2, 0.69) + NOISE[0]),
    "a slow ramp in counts, one row behind": of(
        np.round((0.02 * TIME) / 0.0015) * 0.0015, np.round((0.02 * (TIME - 0.02)) / 0.0015 + NOISE[0] / 0.001) * 0.0015
    ),
    "small motion in a dead band": of(0.002 * np.sin(TIME), 0.0008 * np.sign(np.sin(TIME - 0.3))),
    "a weight that hardly lets it go": of(0.5 * np.sin(TIME), -0.6 + 0.12 * np.sin(TIME - 0.5) + NOISE[0]),
    "a fast chirp that it does not follow": of(
        0.3 * np.sin(TIME**2), -0.1 * np.sin(TIME**2 - 0.5) * np.exp(-TIME / 3) + NOISE[0]
    ),
    "switched off and let fall": of(
        np.full(400, 0.3), 0.3 - 0.25 * (1 - np.exp(-TIME)), enabled=TIME < 1.0
    ),
    "pushed while it holds": of(np.full(400, 0.3), 0.3 + NOISE[0], load=np.where(TIME > 2, 0.5, 0.0)),
    "commands of whole radians": of(np.floor(TIME), TIME - 0.7 + NOISE[0]),
}  # fmt: skip


@pytest.mark.parametrize("name", RIGHT)
def test_what_a_servo_may_do_is_not_refused(name):
    assert checked(RIGHT[name], span=5.0) == []


@pytest.mark.parametrize("one", EXAMPLE.grasps, ids=lambda one: one.name)
def test_the_starter_set_is_right_as_a_whole_and_in_parts(one):
    assert checked(one) == []


ONE_ROW = np.roll(SINE.position_m, 1, axis=0)
FINE = SINE.position_m + NOISE[0][:, None]
WRONG = {
    "counts": ({"position_m": np.round(SINE.position_m * 652)}, "q_rad: whole numbers .*: looks like degrees or c"),
    "degrees": (
        {"position_m": DEGREES * FINE, "command_m": DEGREES * SINE.command_m},
        "q_rad: moves by 2[0-9.]+ rad .* usually moves by 0.5: looks like degrees",
    ),
    "degrees of the command alone": ({"command_m": DEGREES * SINE.command_m}, "goes 5.* the command is in degrees"),
    "degrees of the position alone": (
        {"position_m": 0.1 * DEGREES * FINE, "command_m": 0.1 * SINE.command_m}, "qdes_rad: goes .*position in degrees"
    ),
    "turned round": ({"command_m": -SINE.command_m}, "one of them is turned round"),
    "milliseconds": ({"time_s": 1000 * SINE.time_s}, "t_s: samples are 20 s apart: looks like milliseconds"),
    "microseconds": ({"time_s": 1e6 * SINE.time_s}, "looks like microseconds"),
    "seconds as milliseconds": ({"time_s": 1e-4 * SINE.time_s}, "seconds that were taken for milliseconds"),
    "a fast clock": ({"time_s": 2e-3 * SINE.time_s, "position_m": 3 * FINE}, None),
    "the position as command": ({"command_m": FINE, "position_m": FINE}, "qdes_rad: is the position itself, as it is"),
    "the position of the row before as command": (
        {"command_m": np.roll(FINE, 1, axis=0), "position_m": FINE}, "is the position itself, 1 rows earlier"
    ),
    "the next state as command": (
        {"command_m": np.roll(FINE, -1, axis=0), "position_m": FINE}, "is the position itself, 1 rows later"
    ),
    "a position that never changes": ({"position_m": 0 * SINE.position_m}, "q_rad: never changes; is it the right"),
    "a command that never changes": ({"command_m": 0 * SINE.command_m}, "qdes_rad: never changes; is it the right"),
    "no number": ({"position_m": np.where(TIME == 2, np.nan, SINE.position_m.T).T}, "nan is no finite number"),
    "few samples": ({k: getattr(SINE, k)[:5] for k in ("time_s", "command_m", "position_m", "force_n")}, "5 samples"),
}  # fmt: skip


@pytest.mark.parametrize("name", [name for name, (_, match) in WRONG.items() if match])
def test_what_can_not_be_right_is_refused_in_one_line(name):
    changes, match = WRONG[name]
    with pytest.raises(MeasurementError, match=match) as caught:
        checked(changed(**changes), span=0.5)
    assert "\n" not in str(caught.value)


def test_one_recording_that_holds_still_is_a_warning_and_one_whose_encoder_is_dead_is_not():
    still = changed(name="still", position_m=0.5 + 0 * SINE.position_m, command_m=0.5 + 0 * SINE.command_m)
    assert [line.partition(":")[2] for line in checked(SINE, still)] == [
        " recording 'still', column q_rad: never changes; this recording tells nothing of motion"
    ]
    with pytest.raises(MeasurementError, match="'dead', column q_rad: never changes while its command moves"):
        checked(SINE, changed(name="dead", position_m=0.5 + 0 * SINE.position_m))


def test_gaps_odd_sizes_and_offsets_are_warnings():
    keep = (SINE.time_s < 2) | (SINE.time_s > 3)
    names = ("time_s", "command_m", "position_m", "force_n")
    (line,) = checked(changed(**{name: getattr(SINE, name)[keep] for name in names}))
    assert "t_s=3.02, column t_s: a gap of 1.04 s where samples are 0.02 s apart" in line
    (line,) = checked(SINE, span=0.03)
    assert "moves by 0.39" in line
    (line,) = checked(changed(position_m=SINE.position_m + 2))
    assert "stands +2 rad from its command" in line
    (line,) = checked(changed(command_m=SINE.command_m / 10))
    assert "the position goes 9" in line


def emps(effort: np.ndarray) -> MeasurementSet:
    time = np.arange(len(effort)) * 0.001
    position = 0.1 * np.sin(3 * time)[:, None]
    one = changed(
        time_s=time, command_m=position + 1e-6 * effort[:, None], position_m=position, force_n=effort[:, None],
        columns=columns_of(load_gripper("emps")),
    )  # fmt: skip
    return dataclasses.replace(EXAMPLE, grasps=(one,), gripper="emps")


def test_efforts_are_held_against_motion():
    time = np.arange(4000) * 0.001
    swing = 30 * np.cos(3 * time) + np.random.default_rng(0).standard_normal(4000)
    assert check_servo(emps(swing), [0.25]) == []
    assert check_servo(emps(swing + 100), [0.25]) == []  # a load that never lets it go negative
    with pytest.raises(MeasurementError, match="f_n: never negative, and down to 0 while the joint goes both ways"):
        check_servo(emps(np.abs(swing)), [0.25])
    with pytest.raises(MeasurementError, match="f_n: never changes"):
        check_servo(emps(np.full(4000, 3.0)), [0.25])


def swung(sign: float, name: str) -> MeasuredGrasp:
    """A hinge with a weight, position commands and its effort; released for the last quarter."""
    time = np.arange(1200) * 0.01
    enabled = time < 9
    command = np.where(enabled, 0.8 * np.sin(2 * time), 0.0)
    position = 0.7 * np.sin(2 * time - 0.2)
    speed = np.gradient(position, time)
    effort = np.where(enabled, 14 * (command - position) - 1.1 * speed, 0.0)
    effort += 0.03 * np.random.default_rng(0).standard_normal(1200)
    return changed(
        name=name, time_s=time, command_m=command[:, None], position_m=position[:, None],
        force_n=sign * effort[:, None], enabled=enabled, columns=columns_of(load_gripper("bam_pendulum")),
    )  # fmt: skip


@pytest.mark.parametrize(("signs", "told"), [((1, 1), None), ((-1, -1), "to go; is"), ((1, -1), "to go in b; is")])
def test_an_effort_that_drives_away_from_its_command_is_told(signs, told):
    columns = dataclasses.replace(columns_of(load_gripper("so101_jaw")), force=("tau_nm",))
    recordings = [changed(swung(sign, name), columns=columns) for sign, name in zip(signs, "ab", strict=True)]
    warnings = [w for w in checked(*recordings, span=1.5) if "further" in w]
    assert [told in w for w in warnings if told] == ([True] if told else [])
    assert len(warnings) == (told is not None)


def test_settings_that_no_recording_says_are_told():
    (warning,) = check_servo(dataclasses.replace(EXAMPLE, grasps=(SINE,)), [1.0], settings=("payload_kg", "length_m"))
    assert "recordings.csv has no columns payload_kg, length_m; the scene's own stands for all" in warning
    known = changed(settings={"payload_kg": 0.3})
    assert check_servo(dataclasses.replace(EXAMPLE, grasps=(known,)), [1.0], settings=("payload_kg",)) == []


def test_joints_in_another_order_are_told():
    first, second = np.sin(TIME), np.sin(2.3 * TIME + 1)
    command = np.stack([first, second, 0 * TIME], axis=1)
    follows = 0.95 * np.roll(command, 2, axis=0) + NOISE[0][:, None]
    refuse_swapped("log", ["a", "b", "c"], command, follows)
    for order in ([1, 0, 2], [0, 2, 1], [2, 0, 1], [1, 2, 0]):
        with pytest.raises(MeasurementError, match="whose own does not: commands and positions"):
            refuse_swapped("log", ["a", "b", "c"], command, follows[:, order])
    shaken = np.stack([follows[:, 0], 0.01 * follows[:, 0]], axis=1)  # the second joint is shaken by the first
    refuse_swapped("log", ["a", "b"], np.stack([first, 0.01 * second], axis=1), shaken)
