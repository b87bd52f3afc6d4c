"""Each format as its authors write it: made up here, and real files where they lie beside the checkout."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import scipy.io
import torch

import forcegrasp.assets
from forcegrasp.errors import ConfigError, MeasurementError
from forcegrasp.importers import read_source

ASSETS = Path(forcegrasp.assets.__file__).parent / "mechanisms"
REAL = Path(os.environ.get("FORCEGRASP_REAL") or Path(__file__).parents[3] / "shared" / "real")
TIME = np.arange(50) * 0.02
COMMAND = 0.5 + 0.3 * np.sin(4 * TIME)
POSITION = np.round((0.5 + 0.3 * np.sin(4 * TIME - 0.1)) / 0.000657) * 0.000657


def sage(folder: Path) -> Path:
    rows = zip(TIME * 1e6, COMMAND, strict=True)
    (folder / "joint_list.txt").write_text("Elbow\nJaw\n")
    text = "".join(f'CONTROL,{t},"[0.1, {c}]"\n' for t, c in rows)
    (folder / "control.csv").write_text("type,timestamp,positions\n" + text)
    text = "".join(f'STATE,{t},"[0.1, {p}]","[0, 0]","[0.1, 0.2]"\n' for t, p in zip(TIME * 1e6, POSITION, strict=True))
    (folder / "state_motor.csv").write_text("type,timestamp,positions,velocities,torques\n" + text)
    return folder


def bam(folder: Path) -> Path:
    entries = [
        {"timestamp": 5.0 + t, "goal_position": c, "position": p, "load": 3, "torque_enable": bool(t < 0.5), "temp": 29}
        for t, c, p in zip(TIME, COMMAND, POSITION, strict=True)
    ]
    file = folder / "log.json"
    file.write_text(json.dumps({"kp": 200, "mass": 0.49, "length": 0.1, "motor": "xl330", "entries": entries}))
    return file


def emps(folder: Path) -> Path:
    one = {"t": TIME, "qg": COMMAND, "qm": POSITION, "vir": np.ones(50), "gtau": 35.0, "kp": 160.0, "kv": 243.0}
    file = folder / "run.mat"
    scipy.io.savemat(file, one | {"pulses_N": np.zeros(50, np.uint8)})
    return file


def dfki(folder: Path) -> Path:
    rows = "".join(f"{t},{p},0.0,{c}\n" for t, c, p in zip(TIME, COMMAND, POSITION, strict=True))
    (folder / "data_measured.csv").write_text("time,position,velocity,torque\n" + rows)
    return folder


def pace(folder: Path) -> Path:
    file = folder / "chirp.pt"
    both = {"dof_pos": torch.tensor(POSITION)[:, None], "des_dof_pos": torch.tensor(COMMAND)[:, None]}
    torch.save({"time": torch.tensor(TIME), **both}, file)
    return file


def lerobot(folder: Path) -> Path:
    frames = {
        "action": [[c] for c in COMMAND], "observation.state": [[p] for p in POSITION], "timestamp": TIME,
        "episode_index": np.repeat([0, 1], 25),
    }  # fmt: skip
    (folder / "data" / "chunk-000").mkdir(parents=True)
    (folder / "meta").mkdir()
    (folder / "meta" / "info.json").write_text(json.dumps({"features": {"action": {"names": ["gripper.pos"]}}}))
    pl.DataFrame(frames).write_parquet(folder / "data" / "chunk-000" / "file-000.parquet")
    return folder


MADE = {"sage": sage, "bam": bam, "emps": emps, "dfki": dfki, "pace": pace, "lerobot": lerobot}


@pytest.mark.parametrize("name", MADE)
def test_each_format_gives_time_command_and_position(name, tmp_path):
    found = read_source([MADE[name](tmp_path)], name, "", [])
    assert [len(one.time_s) for one in found] == ([25, 25] if name == "lerobot" else [50])
    scale = 2 * np.pi / 4096 / 0.000657 if name == "sage" else 1.0
    command, position = (np.concatenate([getattr(one, key)[:, -1] for one in found]) for key in ("command", "position"))
    np.testing.assert_allclose(position, POSITION * scale, rtol=1e-6)
    np.testing.assert_allclose(command, COMMAND * scale, rtol=1e-6)
    np.testing.assert_allclose(found[0].time_s, TIME[: len(found[0].time_s)], atol=1e-9)


def test_what_comes_beside_positions(tmp_path):
    (one,) = read_source([bam(tmp_path)], "bam", "", [])
    assert one.settings == {"kp": 200.0, "mass": 0.49, "length": 0.1}
    assert one.enabled is not None
    assert one.enabled.sum() == 25
    assert one.notes == ("skipped: temp",)
    (one,) = read_source([emps(tmp_path)], "emps", "", [])
    assert one.effort is not None
    assert (one.effort[0, 0], one.effort_unit) == (35.0, "N")
    (one,) = read_source([dfki(tmp_path)], "dfki", "", [])
    assert one.command_unit == "N·m"
    (one,) = read_source([sage(tmp_path)], "sage", "", ["Jaw"])
    assert one.joints == ("Jaw",)
    assert not one.effort_signed


def test_a_map_brings_any_table_to_si(tmp_path):
    rows = "".join(f"{1000 * t},{np.rad2deg(c)},{-p / (2 * np.pi) * 4096},{i % 2},x\n" for i, (t, c, p) in enumerate(
        zip(TIME, COMMAND, POSITION, strict=True)))  # fmt: skip
    (tmp_path / "log.csv").write_text("ms,goal,counts,run,comment\n" + rows)
    (tmp_path / "map.yaml").write_text(
        "time: {column: ms, unit: ms}\njoints: [jaw]\ncommand: {column: goal, unit: deg}\n"
        "position: {column: counts, unit: counts, per_turn: 4096, sign: -1, offset: 0.5}\nrecording: run\n"
    )
    first, second = read_source([tmp_path / "log.csv"], "", str(tmp_path / "map.yaml"), [])
    np.testing.assert_allclose(first.position[:, 0], POSITION[::2] + 0.5)
    np.testing.assert_allclose(second.command[:, 0], COMMAND[1::2])
    assert (first.name, second.name) == ("log_0", "log_1")


def refused(match: str, *arguments) -> None:
    with pytest.raises((ConfigError, MeasurementError), match=match) as caught:
        read_source(*arguments)
    assert "\n" not in str(caught.value)


def test_what_does_not_fit_is_told_in_one_line(tmp_path):
    (tmp_path / "log.csv").write_text("t,goal,pos\n" + "".join(f"{i},0,0\n" for i in range(5)))
    refused("either format=sage|", [tmp_path], "", "", [])
    refused("format=sgae: no such format.*sage", [tmp_path], "sgae", "", [])
    refused("no such file", [tmp_path / "none"], "bam", "", [])
    refused("holds no recording of format emps", [tmp_path], "emps", "", [])
    refused("is no log of BAM", [tmp_path / "log.csv"], "bam", "", [])
    refused("MATLAB", [tmp_path / "log.csv"], "emps", "", [])
    for text, match in (
        (
            "tmie: t",
            r"tmie: unknown; did you mean time\?; also joints: missing.*also command: missing.*position: missing",
        ),
        ("joints: a\ncommand: goal\nposition: pos", "time: missing, such as"),
        (
            "time: {column: t, unit: h}\njoints: a\ncommand: goal\nposition: pos",
            "time.unit: must be s, ms, us or ns, not h",
        ),
        (
            "time: t\njoints: a\ncommand: gaol\nposition: p",
            "no column called gaol, p; it has t, goal, pos",
        ),
        ("time: t\njoints: a\ncommand: goal\nposition: {column: pos, unit: counts}", "per_turn"),
        ("time: t\njoints: a\ncommand: goal\nposition: {column: pos, scale: x}", "position.scale: 'x' is not a number"),
    ):
        (tmp_path / "map.yaml").write_text(text)
        refused(match, [tmp_path / "log.csv"], "", str(tmp_path / "map.yaml"), [])


def test_nothing_in_a_file_of_tensors_is_executed(tmp_path):
    class Trap:
        def __reduce__(self):
            return (Path.touch, (tmp_path / "sprung",))

    torch.save({"time": Trap()}, tmp_path / "trap.pt")
    refused("nothing in it was executed", [tmp_path / "trap.pt"], "pace", "", [])
    assert not (tmp_path / "sprung").exists()


@pytest.mark.skipif(not REAL.is_dir(), reason=f"no real recordings in {REAL}; set FORCEGRASP_REAL")
@pytest.mark.parametrize(
    ("folder", "name", "recordings", "samples"),
    [
        ("so101_jaw", "sage", 10, 57042),
        ("xl330", "bam", 8, 10148),
        ("emps", "emps", 2, 49682),
        ("dfki_pendulum", "dfki", 1, 1170),
    ],
)
def test_real_recordings_load(folder, name, recordings, samples):
    found = read_source([REAL / folder], name, "", [])
    assert len(found) == recordings
    assert sum(len(one.time_s) for one in found) == samples
    assert all(np.isfinite(one.position).all() and np.isfinite(one.command).all() for one in found)


def table(tmp_path: Path, time: list[float], more: str = "0.1") -> list:
    rows = "".join(f"{t},{np.sin(i)},{np.cos(i) if i != 4 else more}\n" for i, t in enumerate(time))
    (tmp_path / "log.csv").write_text("t,goal,pos\n" + rows)
    (tmp_path / "map.yaml").write_text("time: t\njoints: a\ncommand: goal\nposition: pos")
    return read_source([tmp_path / "log.csv"], "", str(tmp_path / "map.yaml"), [])


def test_rows_without_a_number_or_a_time_of_their_own_are_left_out_and_counted(tmp_path):
    (one,) = table(tmp_path, [5.0, 5.1, 5.2, 5.2, 5.3, 5.4], more="")
    np.testing.assert_allclose(one.time_s, [0, 0.1, 0.2, 0.4])
    np.testing.assert_allclose(one.command[:, 0], np.sin([0, 1, 2, 5]))
    assert one.notes == (
        "log: left out 1 row without a number",
        "log: left out 1 row with a time stamp that was there",
    )
    with pytest.raises(MeasurementError, match=r"log: time runs back from 5.2 to 5 s; .*`recording: run`"):
        table(tmp_path, [5.0, 5.1, 5.2, 5.0, 5.1, 5.2])
    with pytest.raises(MeasurementError, match="needs at least two rows"):
        table(tmp_path, [5.0, 5.0, 5.0])


def test_a_folder_may_hold_other_files_and_recordings_of_the_same_name(tmp_path):
    for run in ("monday", "tuesday"):
        (tmp_path / "logs" / run).mkdir(parents=True)
        rows = "".join(f"{t},{c},{p}\n" for t, c, p in zip(TIME, COMMAND, POSITION, strict=True))
        (tmp_path / "logs" / run / "log.csv").write_text("t,goal,pos\n" + rows)
        (tmp_path / "logs" / run / "events.csv").write_text("what,when\nstart,1\nend,2\n")
    (tmp_path / "map.yaml").write_text("time: t\njoints: a\ncommand: goal\nposition: pos")
    found = read_source([tmp_path / "logs"], "", str(tmp_path / "map.yaml"), [])
    assert [one.name for one in found] == ["monday_log", "tuesday_log"]
    assert found[0].notes == ("left out, for it is no recording: events.csv, events.csv",)
    single = [tmp_path / "logs" / "monday" / "log.csv", tmp_path / "logs" / "tuesday"]
    assert [one.name for one in read_source(single, "", str(tmp_path / "map.yaml"), [])] == [
        "monday_log",
        "tuesday_log",
    ]
    refused("no column called t, goal, pos; it has when, what", [tmp_path / "logs" / "monday" / "events.csv"], "",
            str(tmp_path / "map.yaml"), [])  # fmt: skip
    (tmp_path / "logs" / "monday" / "log.csv").write_text("t,goal\n0,1\n1,2\n")
    refused(
        "monday/log.csv: no column called pos; it has t, goal", [tmp_path / "logs"], "", str(tmp_path / "map.yaml"), []
    )
    bam(tmp_path / "logs")
    (tmp_path / "logs" / "settings.json").write_text('{"kp": 3}')
    (one,) = read_source([tmp_path / "logs"], "bam", "", [])
    assert one.notes == ("left out, for it is no recording: settings.json", "skipped: temp")


def test_a_table_as_a_spreadsheet_writes_it_and_one_that_was_cut_short(tmp_path):
    lines = [f"{t:.2f};{c:.4f};{p:.4f};on" for t, c, p in zip(TIME, COMMAND, POSITION, strict=True)]
    text = "# made by hand\nt;goal;pos;state\n" + "\n".join(lines).replace(".", ",") + "\n1,00;0,5"
    (tmp_path / "log.csv").write_text(text)
    (tmp_path / "map.yaml").write_text("time: t\njoints: a\ncommand: goal\nposition: pos")
    (one,) = read_source([tmp_path / "log.csv"], "", str(tmp_path / "map.yaml"), [])
    np.testing.assert_allclose(one.position[:, 0], POSITION, atol=1e-4)
    assert one.notes == (
        "log.csv: its cells are separated by semicolons", "log.csv: left out the last line, which was cut short",
        "skipped: state",
    )  # fmt: skip
    (tmp_path / "map.yaml").write_text("time: t\njoints: a\ncommand: state\nposition: pos")
    refused(
        r"no numbers in column state \(row 3 has 'on'\)", [tmp_path / "log.csv"], "", str(tmp_path / "map.yaml"), []
    )


def test_all_that_is_wrong_of_a_map_is_told_at_once(tmp_path):
    (tmp_path / "map.yaml").write_text(
        "time: {column: t, unit: hours}\njoints: [a, b]\ncommand: {column: goal, unt: deg}\n"
        "position: {column: pos, unit: counts}\neffort: {column: i, scale: 0}\n"
    )
    refused("command.unt: unknown; did you mean unit.*time.unit: must be.*per_turn: missing.*effort.scale: must not",
            [tmp_path], "", str(tmp_path / "map.yaml"), [])  # fmt: skip
    (tmp_path / "map.yaml").write_text("time: t\njoints: [a, b]\ncommand: goal\nposition: 'pos_{joint}'\n")
    refused("command.column: goal: 2 joints need `{joint}` in it", [tmp_path], "", str(tmp_path / "map.yaml"), [])
