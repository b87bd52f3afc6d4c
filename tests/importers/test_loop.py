"""From a servo's log to the missing effect: the starter set, cut into windows, compared and diagnosed."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis.diagnose_set import chosen_effects, diagnose_set
from forcegrasp.diagnosis.noise.noise_check import unexpected_noise
from forcegrasp.errors import ConfigError, MeasurementError
from forcegrasp.identify import loading, windows
from forcegrasp.identify.comparison import compare
from forcegrasp.identify.cross_validation import make_folds
from forcegrasp.identify.progress import silent
from forcegrasp.identify.target import make_target
from forcegrasp.importers.example import FRICTION_NM, example_set
from forcegrasp.importers.recording import Recording
from forcegrasp.importers.servo_set import as_set
from forcegrasp.measure import write_servo_set
from forcegrasp.measure.schema import MeasurementSet
from forcegrasp.physics import load_gripper
from forcegrasp.physics.gripper import SKEW
from forcegrasp.physics.plant import Plant
from forcegrasp.replay.replay import Replay
from forcegrasp.reports.comparison import compare_json, details, sections
from forcegrasp.reports.diagnosis import lines
from forcegrasp.reports.html import Picture


@pytest.fixture(scope="module")
def example() -> MeasurementSet:
    return example_set()


@pytest.mark.long
def test_the_friction_hidden_in_the_starter_set_is_found(example, tmp_path):
    few = dataclasses.replace(example, grasps=example.grasps[1:4])
    loaded = loading.load(write_servo_set(few, tmp_path / "set"))
    diagnosis, _ = diagnose_set(loaded, None, ["coulomb_friction", "command_deadband"], 0, silent)
    assert diagnosis.preferred == ("quantisation", "coulomb_friction")
    assert diagnosis.error_after < 1.1 * diagnosis.floor < 0.5 * diagnosis.error_before
    (friction,) = [one.values[0] for one in diagnosis.fit.problem.case(diagnosis.fit.vector).effects]
    assert friction == pytest.approx(FRICTION_NM, rel=0.05)
    (told,) = [line for line in lines(diagnosis, None) if line.startswith("held out, × noise: ")]
    assert len(told.split(", ")) == 1 + len(diagnosis.target.recordings)
    assert {cell.phase for cell in loaded_cells(diagnosis)} <= {"moving", "reversing", "holding", "released"}


def test_of_a_servo_no_slow_noise_is_known(example):
    """It repeats no motion: what a lag leaves is foretold by nothing either."""
    target = make_target(example, load_gripper("so101_jaw"))
    white = 2 * np.random.default_rng(0).standard_normal(target.signals.shape)
    slow = white.copy()
    for sample in range(1, slow.shape[1]):
        slow[:, sample] += 0.7 * slow[:, sample - 1]
    nothing = [np.zeros(white.shape)] * 2
    assert unexpected_noise(np.where(target.mask[..., None], white, 0.0), nothing, target, target.signals) is not None
    assert unexpected_noise(np.where(target.mask[..., None], slow, 0.0), nothing, target, target.signals) is None


def loaded_cells(diagnosis):
    from forcegrasp.reports.findings import remaining

    return remaining(diagnosis).cells()


def test_a_set_is_read_as_it_was_written(example, tmp_path):
    read = loading.load(write_servo_set(example, tmp_path / "set")).measured
    assert isinstance(read, MeasurementSet)
    assert read.fingerprint == example.fingerprint
    assert [one.name for one in read.grasps] == [one.name for one in example.grasps]
    np.testing.assert_array_equal(read.grasps[0].position_m, example.grasps[0].position_m)


def test_windows_start_where_the_servo_was(example):
    sine = next(one for one in example.grasps if one.name == "sine")
    exact = 0.5 + 0.2 * np.sin(np.pi * sine.time_s[:, None])
    parts = windows.cut([dataclasses.replace(sine, position_m=exact, rows=np.arange(len(exact)))])
    assert len(parts) == 9
    for part in parts[1:]:
        assert part.start is not None
        assert part.rows is not None
        speed = 0.2 * np.pi * np.cos(np.pi * sine.time_s[part.rows[0]])
        assert part.start[0] == pytest.approx(exact[part.rows[0]], abs=2e-3)
        assert part.start[1] == pytest.approx(speed, abs=0.05)
        assert part.counts is not None
        assert not part.counts[:10].any()


def test_what_is_known_of_a_start(example):
    """Positions and velocities at the starts of windows scatter as their standard errors say; it moves predictions."""
    sine = next(one for one in example.grasps if one.name == "sine")
    exact, rng = 0.5 + 0.2 * np.sin(np.pi * sine.time_s[:, None]), np.random.default_rng(0)
    off = []
    for _ in range(100):
        noisy = exact + 0.002 * rng.standard_normal(exact.shape)
        for part in windows.cut([dataclasses.replace(sine, position_m=noisy, rows=np.arange(len(exact)))])[1:]:
            assert part.start is not None
            assert part.start_std is not None
            assert part.rows is not None
            true = exact[part.rows[0]], 0.2 * np.pi * np.cos(np.pi * sine.time_s[part.rows[0]])
            off.append([(a - b) / std for a, b, std in zip(part.start, true, part.start_std, strict=True)])
    np.testing.assert_allclose(np.std(np.squeeze(off), axis=0), 1.0, atol=0.25)
    parts = windows.cut([sine])[1:]
    usual, *moved = (
        Replay(load_gripper("so101_jaw"), parts, start_off=by) for by in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
    )
    unsure = [np.stack([part.start_std[i] for part in parts if part.start_std]) for i in (0, 1)]
    for index, name in enumerate(("start_m", "_start_velocity")):
        change = [getattr(replay, name) - getattr(usual, name) for replay in moved]
        np.testing.assert_allclose(np.abs(change[index]), unsure[index])
        assert len(set(np.sign(change[index][:, 0]))) == 2
        assert not change[1 - index].any()


def test_a_start_lies_where_the_servo_is_at_rest_and_no_window_crosses_a_gap(example):
    steps = next(one for one in example.grasps if one.name == "steps")
    for part in windows.cut([steps])[1:]:
        assert part.start is not None
        assert np.abs(part.start[1]) < 0.1  # the steps are of 0.5 rad
    keep = (steps.time_s < 3.0) | (steps.time_s > 4.5)
    names = ("time_s", "command_m", "position_m", "force_n")
    parts = windows.cut([dataclasses.replace(steps, **{name: getattr(steps, name)[keep] for name in names})])
    assert max(np.diff(part.time_s).max() for part in parts) < 0.03
    began = [float(part.name.split()[1]) for part in parts]
    known = [part.before[0] for part in parts if part.before is not None]
    for since, before in zip(began, known, strict=True):  # seconds from the recording's start, or from the gap's end
        reach = min(windows.REMEMBERED_S, since - 4.5 if since > 4 else since)
        assert -before.min(initial=0.0) == pytest.approx(reach, abs=0.03)
    assert max(float(part.name.split()[1]) for part in parts) > 6


def test_of_a_very_long_set_a_quarter_of_the_windows_are_rests(example):
    sine = next(one for one in example.grasps if one.name == "sine")
    time = np.arange(0, 400, 0.02)
    angle = np.where(time < 300, 0.5, 0.5 + 0.2 * np.sin(np.pi * time))[:, None]
    nothing = np.zeros((len(time), sine.force_n.shape[1]))
    long = dataclasses.replace(sine, time_s=time, command_m=angle, position_m=angle, force_n=nothing, rows=None)
    parts = windows.cut([long])
    moving = [np.ptp(part.position_m) > 0.01 for part in parts]
    assert (len(parts), sum(moving)) == (windows.MOST_WINDOWS, windows.MOVING * windows.MOST_WINDOWS)
    assert moving == sorted(moving)
    assert np.diff([float(part.name.split()[1]) for part in parts]).max() < 12


def test_a_window_goes_on_for_as_long_as_its_last_samples_may_be_read_late(example):
    sine, jaw = example.grasps[4], load_gripper("so101_jaw")
    plain, late = windows.cut([sine])[1], windows.cut([sine], jaw.parameters[SKEW])[1]
    assert plain.counts is not None
    assert late.counts is not None
    assert len(plain.time_s) < len(late.time_s) <= len(plain.time_s) + 2  # 30 ms
    assert late.counts.sum() == plain.counts.sum()
    assert not late.counts[len(plain.time_s) :].any()


def test_a_load_pushes_and_a_motor_that_is_off_does_not():
    mechanism = load_gripper("emps")
    plant, ids = Plant(mechanism, 3), np.arange(3)
    plant.reset(ids, np.zeros(3), np.zeros((3, 1)), np.zeros((3, 1)))
    plant.disturb(np.array([0.0, 100.0, 100.0]), np.array([True, True, False]))
    plant.advance(np.zeros((3, 1)), 300)
    still, held, free = plant.position[:, 0]
    assert still == 0
    assert held == pytest.approx(100 / 1370754, rel=0.01)  # the drive's stiffness
    assert free > 10 * held


def test_recordings_with_a_load_are_replayed_with_it(example):
    one = example.grasps[0]
    loaded = dataclasses.replace(one, load=np.full(len(one.time_s), 0.3), start=(one.position_m[0], np.zeros(1)))
    plain = dataclasses.replace(one, start=(one.position_m[0], np.zeros(1)))
    mechanism = load_gripper("so101_jaw")
    base = {name: np.full(2, p.nominal) for name, p in mechanism.parameters.items()}
    motion = Replay(mechanism, [plain, loaded]).simulate(np.arange(2), base)
    at = round(7.4 / 0.002)  # before the last step
    assert (motion.position[1, at] - motion.position[0, at]) == pytest.approx(0.3 / 17.8, rel=0.05)


def test_effects_of_grasped_objects_are_not_a_servos():
    mechanism = load_gripper("so101_jaw")
    names = {effect.name for effect in chosen_effects(mechanism, [])}
    assert {"coulomb_friction", "command_delay", "backlash"} <= names
    assert not names & {"adhesion", "object_friction", "stiffening_contact", "force_lag"}
    with pytest.raises(ConfigError, match="adhesion: is one of grasped objects; so101_jaw grasps nothing"):
        chosen_effects(mechanism, ["adhesion"])


@pytest.mark.parametrize(
    ("changes", "match"), [({"effort_signed": False}, "without a sign"), ({"effort_unit": "A"}, "in A")]
)
def test_efforts_that_the_mechanism_does_not_read_are_refused(changes, match):
    time, zeros = np.arange(20) * 0.01, np.zeros((20, 1))
    plain = Recording("one", ("carriage",), time, zeros, zeros, effort=zeros, effort_unit="N")
    assert as_set([plain], load_gripper("emps"), "", "").grasps[0].force_n.shape == (20, 1)
    with pytest.raises(MeasurementError, match=match):
        as_set([dataclasses.replace(plain, **changes)], load_gripper("emps"), "", "")


def test_errors_are_told_of_each_recording_and_whole_recordings_are_held_out(example, tmp_path):
    three = dataclasses.replace(example, grasps=example.grasps[2:5])
    loaded = loading.load(write_servo_set(three, tmp_path / "set"))
    found, _, _ = compare(loaded, None, 0, silent)
    assert "so101_jaw" in repr(found.target)
    sessions = [grasp.session for grasp in found.target.grasps]
    for fold, name in zip(make_folds(found.target.grasps), dict.fromkeys(sessions), strict=True):
        assert fold.tolist() == [i for i, session in enumerate(sessions) if session == name]
    told = compare_json(found, "set", "", [])["recordings"]
    assert list(told) == [grasp.name for grasp in three.grasps]
    for name, signals in told.items():
        mine = np.array(sessions) == name
        squares = found.heldout[mine][found.target.mask[mine]] ** 2
        assert signals == {"position": pytest.approx(np.sqrt(squares.mean()))}
    (line,) = [line for line in details(found) if line.startswith("by recording, each held out: ")]
    assert all(name in line for name in told)
    grid, rows = found.by_grasp_and_phase()
    assert rows == list(told)
    assert grid.shape == (3, 4)
    words = " ".join(
        block.caption for part in sections(found, []) for block in part.blocks if isinstance(block, Picture)
    )
    assert "Window" in words
    assert "grasp" not in words.lower()
