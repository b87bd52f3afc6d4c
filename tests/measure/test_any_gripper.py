"""Sets of every gripper that comes with the package: one or two motors, metres or radians, one or two forces."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from measured_rig import make_set

from forcegrasp.errors import MeasurementError
from forcegrasp.measure import MeasuredGrasp, MeasurementSet, check_set, check_signs, read_set, write_set
from forcegrasp.measure.schema import TWO_FINGERS, columns_of, fingerprint_of_set
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import load_gripper, shipped_grippers
from forcegrasp.replay.record import record

NAMES = shipped_grippers()
SETS: dict[str, MeasurementSet] = {}


def half_opening(gripper: Gripper) -> float:
    return float(gripper.opening.opening_m[-1]) / 2


def recorded(name: str) -> MeasurementSet:
    """A few noisy grasps of two objects, made once."""
    if name not in SETS:
        gripper = load_gripper(name)
        usual = {"effects": (), "known": {}, "off_nominal": 0.2, "seed": 3}
        noise = (gripper.training.position_std, gripper.training.force_std_n)
        stds = dict(zip(("position_std_m", "force_std_n"), noise, strict=True))
        SETS[name] = record(gripper, "rich", grasps=4, objects=2, **usual, **stds).measured
    return SETS[name]


def changed(measured: MeasurementSet, **signals) -> MeasurementSet:
    """The set with signals of its grasps made from those that are there: name = function of the array."""
    made = [dataclasses.replace(g, **{k: f(getattr(g, k)) for k, f in signals.items()}) for g in measured.grasps]
    return dataclasses.replace(measured, grasps=tuple(made))


def refuse(measured: MeasurementSet, gripper: Gripper, *parts: str) -> None:
    with pytest.raises(MeasurementError) as caught:
        check_set(measured, gripper.stroke, half_opening_m=half_opening(gripper), pads_at=gripper.pads_at)
    for part in parts:
        assert part in str(caught.value)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("samples", ["csv", "parquet"])
def test_what_was_recorded_is_read(name, samples, tmp_path):
    measured, gripper = recorded(name), load_gripper(name)
    read = read_set(write_set(measured, tmp_path / "set", samples))
    assert read.columns == measured.columns == columns_of(gripper)
    assert read.fingerprint == measured.fingerprint
    for one, other in zip(read.grasps, measured.grasps, strict=True):
        assert one.position_m.shape == one.command_m.shape == (len(one.time_s), len(gripper.motors))
        assert one.force_n.shape == (len(one.time_s), len(gripper.forces))
        for array in ("time_s", "command_m", "position_m", "force_n"):
            assert getattr(one, array).tobytes() == np.ascontiguousarray(getattr(other, array)).tobytes()
    assert check_set(read, gripper.stroke, half_opening_m=half_opening(gripper), pads_at=gripper.pads_at) == []


def test_columns_of_two_fingers_are_the_default():
    assert columns_of(load_gripper("tiago")) == TWO_FINGERS
    assert TWO_FINGERS.signals == ("t_s", "qdes_l_m", "qdes_r_m", "q_l_m", "q_r_m", "f_l_n", "f_r_n")


def test_fingerprints_stay():
    """As it was before there were other grippers."""
    time = np.arange(12) / 8
    two = np.stack([time, 2 * time], axis=1)
    grasp = MeasuredGrasp("g", "cup", "monday", 0.02, None, "fit", time, two, two + 0.5, two - 0.25, time - 1)
    golden = "026b99d4679392f7521d41cbe8b6547be6021845499fd53ae25193f78f7c5755"
    assert fingerprint_of_set("tiago", 0.25, None, [grasp]) == golden


def test_columns_of_another_gripper_are_refused(tmp_path):
    folder = write_set(recorded("so101_gripper"), tmp_path / "set")
    meta = folder / "meta.yaml"
    meta.write_text(meta.read_text().replace("so101_gripper", "franka_hand"))
    with pytest.raises(MeasurementError, match="missing columns: qdes_m, q_m, f_l_n, f_r_n"):
        read_set(folder)
    meta.write_text(meta.read_text().replace("franka_hand", "franka_hnd"))
    with pytest.raises(MeasurementError, match=r"meta.yaml: gripper: .*franka_hnd.*did you mean franka_hand"):
        read_set(folder)


def test_a_gripper_without_force_readings(tmp_path):
    measured, gripper = recorded("so101_gripper"), load_gripper("so101_gripper")
    blind = dataclasses.replace(measured.columns, force=())
    grasps = [dataclasses.replace(g, columns=blind, force_n=np.empty((len(g.time_s), 0))) for g in measured.grasps]
    measured = dataclasses.replace(measured, grasps=tuple(grasps), force_std_n=None)
    assert check_set(measured, gripper.stroke, half_opening_m=half_opening(gripper)) == []
    text = (write_set(measured, tmp_path / "set") / "samples.csv").read_text()
    assert text.startswith("grasp,t_s,qdes_rad,q_rad\n")


@pytest.mark.parametrize("name", ["robotiq_2f85", "so101_gripper"])
def test_degrees_are_refused(name):
    wrong = changed(recorded(name), command_m=np.degrees, position_m=np.degrees)
    refuse(wrong, load_gripper(name), "column qdes_rad", "looks like degrees, multiply by π/180")
    turned = changed(recorded(name), position_m=lambda q: q + math.pi)
    refuse(turned, load_gripper(name), "column q_rad", "give radians of the motor")


@pytest.mark.parametrize("name", [name for name in NAMES if name != "tiago"])
def test_what_one_motor_shows_wrong_is_refused(name):
    gripper, measured = load_gripper(name), recorded(name)
    column = measured.columns.position[0]
    refuse(changed(measured, position_m=lambda q: gripper.stroke - q), gripper, f"column {column}", "runs against")
    refuse(changed(measured, position_m=np.zeros_like), gripper, f"column {column}", "never moves", gripper.unit)
    refuse(changed(measured, force_n=np.negative), gripper, measured.columns.force[0], "by -1")
    refuse(changed(measured, force_n=np.zeros_like), gripper, ", ".join(measured.columns.force), "all forces are zero")
    refuse(changed(measured, force_n=np.ones_like), gripper, f"column {measured.columns.force[0]}", "sensor stuck?")


@pytest.mark.parametrize("name", [name for name in NAMES if columns_of(load_gripper(name)).read_effort])
def test_the_effort_of_a_drive_that_is_done_within_a_row(name):
    """The command of a row acts after it was read, so that the effort is that of the row before."""
    gripper = load_gripper(name)

    def swinging(grasp: MeasuredGrasp, sign: float) -> MeasuredGrasp:
        rng, time = np.random.default_rng(len(grasp.name)), np.arange(len(grasp.time_s))
        command = gripper.stroke * (0.6 + 0.3 * np.sin(0.8 * time))[:, None]
        meant = np.concatenate([command[:1], command[:-1]])
        position = np.maximum(meant, 0.5 * gripper.stroke) + 1e-4 * rng.standard_normal(command.shape)
        effort = sign * (8 * (position - meant) / gripper.stroke + 0.05 * rng.standard_normal(command.shape))
        return dataclasses.replace(grasp, command_m=command, position_m=position, force_n=effort)

    for sign in (1.0, -1.0):
        measured = recorded(name)
        measured = dataclasses.replace(measured, grasps=tuple(swinging(g, sign) for g in measured.grasps))
        own = np.concatenate([(g.position_m - g.command_m)[:, 0] for g in measured.grasps])
        assert abs(np.corrcoef(own, np.concatenate([g.force_n[:, 0] for g in measured.grasps]))[0, 1]) < 0.5
        if sign > 0:
            check_signs._check_effort(measured, 0.0, gripper.stroke)
            continue
        with pytest.raises(MeasurementError, match=r"f_n: opens while the command is to close; .* by -1"):
            check_signs._check_effort(measured, 0.0, gripper.stroke)


@pytest.mark.parametrize("name", [name for name in NAMES if columns_of(load_gripper(name)).read_effort])
def test_an_effort_is_not_blamed_for_positions_the_other_way_round(name):
    """Counted as a joint counts that closes upwards from its own zero, commands alike."""
    gripper, measured = load_gripper(name), recorded(name)
    most = max(g.position_m.max() for g in measured.grasps)

    def closing(q: np.ndarray) -> np.ndarray:
        return 0.6 * most - q

    turned = changed(measured, position_m=closing, command_m=closing)
    refuse(turned, gripper, f"column {measured.columns.position[0]}", "past closed", "must be 0 when closed")


@pytest.mark.parametrize("name", NAMES)
def test_pads_stand_where_the_opening_says(name):
    gripper = load_gripper(name)
    positions = np.linspace(0.2, 1.0, 5)[:, None] * gripper.stroke * np.ones(len(gripper.motors))
    pads = gripper.pads_at(positions)
    if name == "so101_gripper":  # one jaw stands still
        assert pads is None
        return
    assert pads is not None
    np.testing.assert_allclose(pads.sum(axis=1), gripper.opening.opening_at(positions[:, 0]))
    assert pads[-1] == pytest.approx([half_opening(gripper)] * 2)


def with_one_motor(grasps: list[MeasuredGrasp], gripper: Gripper, channels: int = 2) -> MeasurementSet:
    """What a rig of two fingers that close alike would have read with one motor, and some of its force sensors."""
    columns = columns_of(gripper)
    columns = dataclasses.replace(columns, force=columns.force[:channels])
    made = [
        dataclasses.replace(
            g,
            columns=columns,
            command_m=gripper.opening.position_at(g.command_m.sum(axis=1))[:, None],
            position_m=gripper.opening.position_at(g.position_m.sum(axis=1))[:, None],
            force_n=g.force_n[:, :channels],
        )
        for g in grasps
    ]
    return make_set(made, gripper=gripper.name, position_std_m=None)


@pytest.mark.parametrize("name", ["franka_hand", "robotiq_2f85"])
@pytest.mark.parametrize("channels", [1, 2])
def test_forces_in_free_air_and_swapped_fingers_of_one_motor_are_refused(name, channels, grasps):
    gripper = load_gripper(name)
    right = with_one_motor(grasps, gripper, channels)
    check_set(right, gripper.stroke, half_opening_m=half_opening(gripper), pads_at=gripper.pads_at)
    if channels == 2:
        swapped = changed(right, force_n=lambda force: force[:, ::-1])
        refuse(swapped, gripper, "the wrong finger touches first in 4 of 4")
        # of a quicker rig, whose rows are finer and whose fingers touch a twentieth of a second apart
        quick = [dataclasses.replace(g, time_s=g.time_s / 6) for g in swapped.grasps]
        refuse(dataclasses.replace(swapped, grasps=tuple(quick)), gripper, "the wrong finger touches first")
    rng = np.random.default_rng(5)
    touched = [
        dataclasses.replace(g, force_n=g.force_n + (g.time_s < 0.8)[:, None] * rng.normal(0, 1, g.force_n.shape))
        for g in right.grasps
    ]
    refuse(dataclasses.replace(right, grasps=tuple(touched)), gripper, "N in free air", "object_radius_m")


def test_objects_stay_in_metres():
    gripper, measured = load_gripper("so101_gripper"), recorded("so101_gripper")
    grasps = [dataclasses.replace(g, radius_m=1000 * (g.radius_m or 0)) for g in measured.grasps]
    refuse(dataclasses.replace(measured, grasps=tuple(grasps)), gripper, "column object_radius_m", "millimetres")
    assert check_set(measured, gripper.stroke) == []  # how wide it opens need not be known
