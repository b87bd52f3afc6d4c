"""The program that studies public recordings: its yardsticks are published equations, its page says what was found."""

from __future__ import annotations

import json
import subprocess

import numpy as np
import pytest

from tools.marked_part import marks
from tools.real_data import bam_models, dfki_open_loop, dfki_regression, emps_loop, emps_regression
from tools.real_data.page import WRITER, write_page
from tools.real_data.study import Error, Parameter, Study, checksums
from tools.real_data.verbs import Verbs


def test_a_carriage_at_constant_speed_needs_what_its_friction_takes():
    speed, time = 0.1, np.arange(0, 0.5, emps_loop.PERIOD_S)
    one = emps_loop.Carriage()
    position, volts = emps_loop.simulate(one, speed * time, np.zeros_like(time), 0.0).T
    force = one.viscous * speed + one.coulomb + one.offset
    assert emps_loop.GTAU * volts[-1] == pytest.approx(force, rel=1e-3)
    lag = speed * time[-1] - position[-1]
    assert emps_loop.KV * (emps_loop.KP * lag - speed) == pytest.approx(force / emps_loop.GTAU, rel=1e-3)


def test_a_regression_finds_the_friction_that_a_carriage_has():
    time = np.arange(0, 6, emps_loop.PERIOD_S)
    goal, one = 0.1 * np.sin(2 * np.pi * 0.4 * time), emps_loop.Carriage()
    position, volts = emps_loop.simulate(one, goal, np.zeros_like(time), 0.0).T
    found, left = emps_regression.regress({"qm": position, "vir": volts}, ("offset", "d"))
    truth = {"M": one.mass, "Fv": one.viscous, "Fc": one.coulomb, "offset": one.offset}
    assert {name: found[name] for name in truth} == pytest.approx(truth, rel=0.1)
    assert abs(found["d"]) < 0.05 * one.viscous
    _, without = emps_regression.regress({"qm": position, "vir": volts}, ())
    assert without > 1.5 * left


def test_pulses_push_the_carriage_and_do_not_count_as_the_drives_voltage():
    goal, pulses = np.zeros(400), np.r_[np.zeros(100), np.full(300, 5.0)]
    position, volts = emps_loop.simulate(emps_loop.Carriage(), goal, pulses, 0.0).T
    assert position[-1] > 1e-5
    # it rests where drive and pulse together are within dry friction
    assert abs(emps_loop.GTAU * (volts[-1] + 5.0) - emps_loop.Carriage().offset) < emps_loop.Carriage().coulomb + 0.1


@pytest.mark.parametrize(("late", "milliseconds"), [(0, 0.0), (1, 0.5), (2, 1.0)])
def test_the_lateness_of_a_velocity_is_read_off_the_drives_own_signals(late, milliseconds):
    time = np.arange(0, 4, emps_loop.PERIOD_S)
    goal = 0.03 * np.sin(2 * np.pi * 0.7 * time) + 0.002 * np.sin(2 * np.pi * 3.0 * time)
    position, volts = emps_loop.simulate(emps_loop.Carriage(), goal, 3.0 * (np.sin(9 * time) > 0), 0.0, late).T
    stiffness, damping, delay = emps_loop.velocity_delay(position, goal, volts)
    assert (stiffness, damping) == pytest.approx((1.0, 1.0), abs=0.03)
    assert 1e3 * delay == pytest.approx(milliseconds, abs=0.1)


def test_the_regression_of_the_pendulum_finds_what_was_put_in():
    time = np.arange(0, 4, 1 / 300)
    q = 1.2 * np.sin(2 * np.pi * 0.8 * time) + 0.3 * np.sin(2 * np.pi * 0.3 * time)
    v = np.gradient(q, time)
    truth = {"J": 0.06, "mc": 0.1, "Fv": 0.05, "Fc": 0.18, "offset": -0.08}
    torque = 0.06 * np.gradient(v, time) + 0.1 * 9.81 * np.sin(q) + 0.05 * v + 0.18 * np.arctan(5 * v) - 0.08
    assert dfki_regression.regress(time, q, v, torque, sharpness=5.0) == pytest.approx(truth, rel=0.03)


def test_friction_is_found_in_windows_that_a_torque_moves():
    period, h = 1 / 300, 1 / 3000
    time = np.arange(0, 4, period)
    torque, q, v, path = np.sin(7 * time) + 0.5 * np.sin(17 * time), 0.2, 0.0, []
    for now in torque:
        path.append(q)
        for _ in range(10):
            v += h * (now - 9.81 * 0.3 * np.sin(q) - 0.05 * v - 0.1 * np.arctan(100 * v) + 0.07) / 0.15
            q += h * v
    found = dfki_open_loop.fit(time, np.array(path), torque, 0.15, 0.3)
    assert found.values == pytest.approx((0.05, 0.1, -0.07), abs=0.005)
    assert found.left_rad < 1e-3


def _logs() -> bam_models.Logs:
    time = np.arange(0, 2, bam_models.STEP_S)
    goal = np.stack([np.sin(3 * time), 0.5 * time])
    one = {
        "kp": np.array([200.0, 800.0]),
        "volts": np.full(2, 7.4),
        "mass": np.full(2, 0.49),
        "length": np.full(2, 0.1),
    }
    return bam_models.Logs(("a", "b"), goal, np.ones_like(goal), np.zeros_like(goal), **one)


def test_each_model_of_bam_contains_the_simpler_ones():
    logs = _logs()
    for model, inside in bam_models.CONTAINS.items():
        for simpler in inside:
            known = {name: entry[0] for name, entry in bam_models.MODELS[simpler].items()}
            start = bam_models._as_in(known)
            values = [start.get(name, entry[0]) for name, entry in bam_models.MODELS[model].items()]
            one = bam_models.simulate(simpler, np.array([list(known.values())]), logs)
            assert bam_models.simulate(model, np.array([values]), logs) == pytest.approx(one, abs=1e-12)


def test_a_pendulum_within_its_friction_stays_and_beyond_it_falls():
    logs = _logs()
    off = bam_models.Logs(logs.names, logs.goal, 0 * logs.goal, 0.3 + 0 * logs.goal, *(
        getattr(logs, key) for key in ("kp", "volts", "mass", "length")
    ))  # fmt: skip
    torque = 0.49 * bam_models.GRAVITY * 0.1 * np.sin(0.3)
    values = {name: entry[0] for name, entry in bam_models.MODELS["M1"].items()} | {"q0": 0.0}
    stays, falls = (
        bam_models.simulate("M1", np.array([list((values | {"Kc": share * torque}).values())]), off)[0]
        for share in (1.01, 0.9)
    )
    assert np.ptp(stays) == 0
    assert falls[0, -1] < 0.26


def test_a_fit_of_bam_recovers_a_motor():
    logs = _logs()
    truth = {"k": 0.5, "R": 3.0, "armature": 0.004, "q0": 0.0, "Kc": 0.03, "Kv": 0.01}
    position = bam_models.simulate("M1", np.array([list(truth.values())]), logs)[0]
    seen = bam_models.Logs(logs.names, logs.goal, logs.enabled, position, *(
        getattr(logs, key) for key in ("kp", "volts", "mass", "length")
    ))  # fmt: skip
    cost, fitted = bam_models._fit("M1", seen, {})
    assert bam_models.rms("M1", fitted, seen) < 2e-3
    assert fitted["k"] / fitted["R"] == pytest.approx(0.5 / 3.0, rel=0.1)
    assert cost >= 0


def study() -> Study:
    return Study(
        "emps", "EMPS", "mass", "fitted on one", {"emps/a.mat": "00"}, [], "one_of", "",
        ["coulomb_friction"], ["stiction"],
        [Error("force", "N", 11.0, 5.0, 0.1, 4.8)], [Parameter("mass", 94.5, 91.0, 98.0, "kg", 95.1)],
        {"Yardstick": [["a", "b"], ["1", "2"]]}, ["late by 1 ms"], 12.0,
    )  # fmt: skip


def test_the_page_tells_what_a_study_found(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr("tools.real_data.page.draw_all", lambda studies, *rest: drawn.extend(studies))
    (tmp_path / "emps").mkdir()
    study().write(tmp_path / "emps")
    page = tmp_path / "page.md"
    jaw, gone = (f"| `{name}` | `{'0f' * 32}` |" for name in ("so101_jaw/a.csv", "emps/gone.mat"))
    parts = {"emps": "old", "checksums": f"{jaw}\n{gone}"}
    page.write_text("kept\n" + "\n".join(
        f"{begin}\n{parts[name]}\n{end}" for name, (begin, end) in ((n, marks(f"{WRITER}, {n}")) for n in parts)
    ))  # fmt: skip
    write_page(page, tmp_path, ["emps", "xl330"])
    text = page.read_text()
    assert text.startswith("kept\n")
    assert "old" not in text
    assert "| force | 11 N | 5 N | 4.8 N | 110 → 50 |" in text
    assert "| `mass` | 94.5 [91, 98] kg | 95.1 kg |" in text
    assert "`coulomb_friction` (or `stiction`: these data can't tell)" in text
    assert f"| `emps/a.mat` | `00` |\n{jaw}\n" in text  # of sets that were not studied now they stay
    assert gone not in text
    assert drawn == [study()]
    page.write_text("nothing marked")
    with pytest.raises(SystemExit, match="lacks"):
        write_page(page, tmp_path, ["emps"])


def test_what_was_run_is_not_run_again(tmp_path, monkeypatch):
    ran = []

    def run(command, **_):
        ran.append(command)
        (tmp_path / "study" / "set").mkdir(exist_ok=True)
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr("tools.real_data.verbs.subprocess.run", run)
    for _ in range(2):
        assert Verbs(tmp_path / "study").run("import", "import", "a", makes="set") == tmp_path / "study" / "set"
    assert len(ran) == 1
    Verbs(tmp_path / "study").run("import", "import", "b", makes="set")
    assert len(ran) == 2
    verbs = Verbs(tmp_path / "study")
    verbs.done["diagnosis"] = {"command": [], "seconds": 40.0}
    assert verbs.seconds() == verbs.seconds("import") + verbs.seconds("diagnosis") >= 40.0
    assert json.loads((tmp_path / "study" / "commands.json").read_text())["import"]["command"][1] == "b"


def test_a_command_that_fails_says_why(tmp_path, monkeypatch):
    def run(command, stdout, **_):
        stdout.write("first\nno such file\n")
        stdout.flush()
        return subprocess.CompletedProcess(command, 2)

    monkeypatch.setattr("tools.real_data.verbs.subprocess.run", run)
    with pytest.raises(RuntimeError, match="no such file"):
        Verbs(tmp_path).run("import", "import", makes="set")


def test_checksums_are_of_the_files_below_the_folder(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "b.csv").write_bytes(b"")
    empty = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    assert checksums(tmp_path, [tmp_path / "a" / "b.csv"]) == {"a/b.csv": empty}
