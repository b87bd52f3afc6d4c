"""Sessions of a table of final forces: a shift that was put in is found with its interval, none where none is."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from forcegrasp.final_force.analysis import analyse_table
from forcegrasp.final_force.sessions import repeats_of
from forcegrasp.measure import read_set
from forcegrasp.measure.schema import FinalForceTable
from forcegrasp.measure.write import write_table
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.reports import final_force as final_force_report

DELTA_M = np.arange(1, 11) * 3e-4
NOISE_N = 0.02


def two_sessions(shift_n: float, seed: int, apart_m: float = 0.0) -> dict:
    """The same objects in two sessions, the second with a shift; ``apart_m`` moves its deltas away from the first's."""
    rng = np.random.default_rng(seed)
    objects, deltas, forces, sessions = [], [], [], []
    for session, shift, apart in (("monday", 0.0, 0.0), ("friday", shift_n, apart_m)):
        for name, slope in (("sponge", 260.0), ("wood", 330.0)):
            delta = DELTA_M + apart
            objects += [name] * len(delta)
            sessions += [session] * len(delta)
            deltas += delta.tolist()
            forces += (slope * delta + shift + NOISE_N * rng.standard_normal(len(delta))).tolist()
    return {"objects": objects, "delta_m": np.array(deltas), "force_n": np.array(forces), "sessions": sessions}


def as_table(rows: dict) -> FinalForceTable:
    return FinalForceTable(
        Path("t"), "t", "tiago", "", "", None, tuple(rows["objects"]), rows["delta_m"], rows["force_n"], "0" * 64,
        sessions=tuple(rows["sessions"]),
    )  # fmt: skip


def test_a_shift_is_found_with_its_interval_and_the_noise():
    found = repeats_of(**two_sessions(0.06, 1))
    (shift,) = found.shifts
    assert found.shifted
    assert (shift.session, shift.squeezes) == ("friday", 20)
    assert shift.low < 0.06 < shift.high
    assert shift.high - shift.low == pytest.approx(2 * 2.093 * NOISE_N * np.sqrt(2 / 20), rel=0.5)
    assert found.noise_n == pytest.approx(NOISE_N, rel=0.4)
    assert found.freedom == 19


def test_it_is_the_paired_t_test_of_two_sessions():
    from scipy.stats import ttest_rel

    rows = two_sessions(0.02, 2)
    first, second = rows["force_n"][:20], rows["force_n"][20:]
    found = repeats_of(**rows)
    assert found.shifts[0].value == pytest.approx(np.mean(second - first))
    assert found.noise_n == pytest.approx(np.std(second - first, ddof=1) / np.sqrt(2))
    assert found.p == pytest.approx(ttest_rel(second, first).pvalue)


def test_intervals_hold_the_shift_and_alarms_are_rare():
    held = [repeats_of(**two_sessions(0.03, seed)) for seed in range(200)]
    inside = sum(r.shifts[0].low < 0.03 < r.shifts[0].high for r in held)
    assert inside >= 180
    alarms = sum(repeats_of(**two_sessions(0.0, 1000 + seed)).shifted for seed in range(200))
    assert alarms <= 20


def test_sessions_without_a_common_squeeze_are_not_told_apart():
    found = repeats_of(**two_sessions(0.5, 3, apart_m=1e-4))
    assert found.shifts == ()
    assert found.untold == ("friday",)
    assert not found.shifted


def test_a_third_session_is_told_by_way_of_the_second():
    objects = ["a"] * 24
    delta = np.r_[DELTA_M[:6], DELTA_M[:6], DELTA_M[4:10], DELTA_M[4:10]]
    sessions = ["one"] * 6 + ["two"] * 6 + ["two"] * 6 + ["three"] * 6
    truth = {"one": 0.0, "two": 0.1, "three": -0.05}
    force = 300 * delta + np.array([truth[s] for s in sessions])
    force += 1e-3 * np.random.default_rng(4).standard_normal(24)
    found = repeats_of(objects, delta, force, sessions)
    assert {s.session: round(s.value, 2) for s in found.shifts} == {"two": 0.1, "three": -0.05}


def test_a_shift_is_taken_out_before_shapes_are_fitted():
    gripper = load_gripper("tiago")
    found = analyse_table(as_table(two_sessions(0.2, 5)), gripper)
    assert found.verdict == "explained"
    assert found.base.fits["wood"].slope == pytest.approx(330, rel=0.03)
    assert found.noise_from == "from 19 repeated squeezes"
    told = " ".join(final_force_report.facts(found))
    assert "session friday reads +0.195 N [+0.184, +0.206]" in told
    assert "taken out" in told
    document = final_force_report.diagnosis_json(found)["sessions"]
    assert document["taken_out"] is True
    assert json.loads(json.dumps(document)) == document
    final_force_report.draw(found)


def test_a_table_with_sessions_comes_back_as_it_was_written(tmp_path):
    table = as_table(two_sessions(0.1, 6))
    read = read_set(write_table(table, tmp_path / "set"))
    assert read.sessions == table.sessions
    header = (tmp_path / "set" / "table.csv").read_text().splitlines()
    (tmp_path / "set" / "table.csv").write_text("\n".join(line.rsplit(",", 1)[0] for line in header) + "\n")
    without = read_set(tmp_path / "set")
    assert without.sessions == ()
    assert without.fingerprint != read.fingerprint
    analysis = analyse_table(without, load_gripper("tiago"))
    assert analysis.repeats.shifts == ()
    assert "sessions" not in final_force_report.diagnosis_json(analysis)
