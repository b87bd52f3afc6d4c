"""Each format as others of its recorders, robots and versions write it; all made up here."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import scipy.io
import torch

from forcegrasp.cli.main import main
from forcegrasp.errors import MeasurementError
from forcegrasp.importers import Recording, mechanism_of, read_source, unlike

TIME = np.arange(60) * 0.02
COMMAND = np.sin(5 * TIME)
POSITION = np.sin(5 * TIME - 0.2)


def read(source: Path, name: str, *joints: str) -> Recording:
    (one,) = read_source([source], name, "", joints)
    return one


def refused(source: Path, name: str, match: str) -> None:
    with pytest.raises(MeasurementError, match=match) as caught:
        read_source([source], name, "", [])
    assert "\n" not in str(caught.value)


def sage(
    folder: Path, joints: list[str], unit: float = 1e6, commands: int = 2, late: float = 0.0, scale: float = 1.0
) -> Path:
    """Joints that all do the same; two of them in a state; states so much later than commands, from the second on."""
    folder.mkdir(exist_ok=True)
    (folder / "joint_list.txt").write_text("".join(f"/robot/{name}\n" for name in joints))
    rows = [f'CONTROL,{t * unit},"{[c] * commands}"\n' for t, c in zip(TIME, (scale * COMMAND).tolist(), strict=True)]
    (folder / "control.csv").write_text("type,timestamp,positions\n" + "".join(rows))
    rows = [
        f'STATE_MOTOR,{(t + late) * unit},"{[p] * 2}","{[0.0] * 2}","{[-p] * 2}"\n'
        for t, p in list(zip(TIME, (scale * POSITION).tolist(), strict=True))[1:]
    ]
    (folder / "state_motor.csv").write_text("type,timestamp,positions,velocities,torques\n" + "".join(rows))
    return folder


def test_sage_of_unitree_states_the_last_joints_and_stamps_of_10_us(tmp_path):
    folder = sage(tmp_path / "walk", ["leg", "left", "right"], unit=1e5, commands=3)
    (folder / "event.csv").write_text("type,timestamp,event\nEVENT,0,MOTION_START\nEVENT,9,MOTION_END\n")
    one = read(folder / "control.csv", "sage")
    assert (one.name, one.joints, one.effort_signed) == ("walk", ("left", "right"), True)
    np.testing.assert_allclose(np.diff(one.time_s), 0.02)
    assert one.notes[:2] == (
        "a row has 2 numbers for 3 joints: taken as left to right",
        "time stamps are taken as 10 µs each, as those collectors write them that say MOTION_END",
    )
    (line,) = unlike("sage", [one])
    assert "if left, right is none" in line


def test_sage_joins_commands_and_states_by_their_stamps(tmp_path):
    one = read(sage(tmp_path / "arm", ["left", "jaw"], late=0.005), "sage", "left")
    np.testing.assert_allclose(one.command[:, 0], COMMAND[1:-1])  # the state after the last command is nobody's
    np.testing.assert_allclose(one.position[:, 0], POSITION[1:-1])
    assert "commands have time stamps of their own: a state has the newest command before it" in one.notes
    one = read(sage(tmp_path / "sim", ["left", "jaw"], unit=1.0), "sage")
    np.testing.assert_allclose(np.diff(one.time_s), 0.02)
    (tmp_path / "sim" / "joint_list.txt").unlink()
    assert read(tmp_path / "sim", "sage").joints == ("joint_0", "joint_1")


def test_sage_with_events_between_the_rows_degrees_and_numbers_of_numpy(tmp_path):
    folder = sage(tmp_path / "arm", ["left", "right"])
    plain = read(folder, "sage")
    for name in ("control.csv", "state_motor.csv"):
        head, *rows = (folder / name).read_text().splitlines()
        rows = [r.replace("[", "[np.float64(").replace(", ", "), np.float64(").replace("]", ")]") for r in rows]
        (folder / name).write_text("\n".join([head, 'EVENT,0,"MOTION_START"', *rows]))
    np.testing.assert_array_equal(read(folder, "sage").position, plain.position)
    folder = sage(tmp_path / "degrees", ["left", "right"], scale=90.0)
    one = read(folder, "sage")
    np.testing.assert_allclose(one.position, np.deg2rad(90 * plain.position))
    np.testing.assert_allclose(one.command, np.deg2rad(90 * plain.command))
    assert "positions are taken as degrees" in one.notes


def test_a_number_that_a_joint_lacks_costs_the_row_only_where_the_joint_is_asked_for(tmp_path):
    folder = sage(tmp_path / "arm", ["left", "right"])
    text = (folder / "state_motor.csv").read_text().splitlines()
    text[5] = text[5].replace(f", {POSITION[5]}]", ", nan]", 1)
    (folder / "state_motor.csv").write_text("\n".join(text))
    assert len(read(folder, "sage", "left").time_s) == 59
    assert len(read(folder, "sage", "right").time_s) == 58


def test_a_pointer_of_git_lfs_is_called_so(tmp_path):
    pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n"
    folder = sage(tmp_path / "arm", ["left", "right"])
    kinds = {"csv": "dfki", "json": "bam", "mat": "emps", "pt": "pace", "parquet": "lerobot"}
    for file in (folder / "control.csv", *(tmp_path / f"a.{suffix}" for suffix in kinds)):
        file.write_text(pointer)
        refused(
            file,
            kinds[file.suffix[1:]] if file.stem == "a" else "sage",
            "Git LFS left only a pointer to it here; fetch it with: git lfs pull",
        )


def bam(file: Path, **more: object) -> Path:
    entries = [
        {"timestamp": t, "goal_position": c, "position": p, "speed": 0.0, "torque_enable": bool(t < 0.5), "load": 1}
        for t, c, p in zip(TIME, COMMAND, POSITION, strict=True)
    ]
    file.write_text(json.dumps({"kp": 32, "mass": 1.13, "length": 0.12, "motor": "mx106", "entries": entries} | more))
    return file


def test_bam_of_other_recorders(tmp_path):
    one = read(bam(tmp_path / "mx.json", **{"arm-mass": 0.02, "vin": 15.0}), "bam")
    assert one.settings == {"kp": 32.0, "mass": 1.13, "length": 0.12, "arm_mass": 0.02, "vin": 15.0}
    other = read(bam(tmp_path / "xl.json", motor="xl330"), "bam")
    assert [mechanism_of("bam", [log]) for log in (one, other)] == ["bam_pendulum", "xl330_pendulum"]
    assert mechanism_of("sage", [one]) == "so101_jaw"
    both = "mx_sin of bam_pendulum, xl_sin of xl330_pendulum: recordings of several mechanisms; import them apart"
    with pytest.raises(MeasurementError, match=both.replace("_sin", "")):
        mechanism_of("bam", [one, other])

    log = json.loads((tmp_path / "mx.json").read_text())
    for entry in log["entries"]:
        del entry["timestamp"]
    del log["entries"][0]["speed"], log["entries"][0]["torque_enable"]
    log["entries"][3]["position"] = None
    (tmp_path / "at.json").write_text(json.dumps(log))
    refused(tmp_path / "at.json", "bam", "entries lack timestamp; they have goal_position, load, position")
    (tmp_path / "at.json").write_text(json.dumps(log | {"dt": 0.005}))
    one = read(tmp_path / "at.json", "bam")
    np.testing.assert_allclose(one.time_s[:3], [0, 0.005, 0.015])
    assert one.notes[-1] == "at: left out 2 rows without a number"
    for broken in ("[1, 2]", '{"entries": 3}', '{"entries": ["a"]}', '{"entries": []}', '{"entries": [[1]]}'):
        (tmp_path / "at.json").write_text(broken)
        refused(tmp_path / "at.json", "bam", "is no log of BAM")
    refused(bam(tmp_path / "at.json", entries=[{"timestamp": 0, "goal_position": 0, "position": "x"}]), "bam",
            "at.json: entry 0: position must be a number")  # fmt: skip


def test_bam_s_resampled_copies_are_not_taken_for_more_recordings(tmp_path):
    for folder in ("data_raw", "data_processed"):
        (tmp_path / folder).mkdir()
        bam(tmp_path / folder / "2026.json")
    one = read(tmp_path, "bam")
    assert one.name == "2026"
    assert one.notes[-1] == "logs are taken as they were recorded, and their copies in processed left out"
    assert not [note for note in read(tmp_path / "data_processed", "bam").notes if "copies" in note]


def test_the_verb_takes_the_mechanism_of_the_logs_servo_where_none_is_given(tmp_path, capsys):
    for given, motor, taken in (("", "mx106", "bam"), ("", "xl330", "xl330"), ("xl330_pendulum", "mx106", "xl330")):
        log = str(bam(tmp_path / "a.json", motor=motor))
        assert main(["import", log, "format=bam", f"out={tmp_path / (motor + given)}", f"mechanism={given}"]) == 0
        assert f"60 samples of {taken}_pendulum" in capsys.readouterr().out


def test_emps_without_the_constants_of_its_drive_and_with_broken_signals(tmp_path):
    signals = {"t": TIME, "qg": COMMAND[:, None], "qm": POSITION, "vir": np.ones(60)}
    scipy.io.savemat(tmp_path / "a.mat", signals)
    one = read(tmp_path / "a.mat", "emps")
    assert one.settings == {"gtau": 35.15, "kp": 160.18, "kv": 243.45}
    assert one.notes[0] == "gtau: not in it, taken as published, 35.15"
    scipy.io.savemat(tmp_path / "a.mat", signals | {"qm": POSITION[1:]})
    refused(tmp_path / "a.mat", "emps", "signals of different lengths: t 60, qg 60, qm 59, vir 60")
    scipy.io.savemat(tmp_path / "a.mat", signals | {"qm": "text"})
    refused(tmp_path / "a.mat", "emps", "must be numbers")


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("time,position,velocity,torque", "{t},{p},0,{c}"),
        (",time,pos,vel,torque", "{i},{t},{p},0,{c}"),
        ("des_time,des_pos,des_vel,des_tau,meas_time,meas_pos,meas_vel,meas_tau", "0,9,9,9,{t},{p},0,{c}"),
    ],
)
def test_headers_of_dfki(header, row, tmp_path):
    rows = [row.format(i=i, t=t, p=p, c=c) for i, (t, c, p) in enumerate(zip(TIME, COMMAND, POSITION, strict=True))]
    for name in ("data_measured_1kg.csv", "experiment_trajectory.csv", "data_desired.csv"):
        (tmp_path / name).write_text("\n".join([header, *rows]))
    found = read_source([tmp_path], "dfki", "", [])
    assert [one.name for one in found] == [f"{tmp_path.name}_1kg", f"{tmp_path.name}_experiment_trajectory"]
    for one in (*found, read(tmp_path / "experiment_trajectory.csv", "dfki")):
        np.testing.assert_allclose(one.position[:, 0], POSITION)
        np.testing.assert_allclose(one.command[:, 0], COMMAND)
    refused(tmp_path / "data_desired.csv", "dfki", "give the file of what was measured")


def test_a_control_loop_of_dfki_that_was_stopped_leaves_zeros(tmp_path):
    rows = [f"{t},{p},0,{c}" for t, c, p in zip(TIME, COMMAND, POSITION, strict=True)] + ["0,0,0,0"] * 5
    (tmp_path / "measured_data.csv").write_text("\n".join(["time,pos,vel,tau", *rows]))
    one = read(tmp_path, "dfki")
    np.testing.assert_allclose(one.position[:, 0], POSITION)
    np.testing.assert_allclose(one.command[:, 0], COMMAND)
    assert one.notes[-1] == "measured_data.csv: left out 5 rows of zeros after the end"
    (tmp_path / "measured_data.csv").write_text("time,pos,vel,torque\n0,(1+2j),0,1\n1,(1+2j),0,1\n")
    refused(tmp_path, "dfki", "no numbers in a column position; it has time, vel, torque, pos")


def test_pace_with_names_of_joints_and_more_beside(tmp_path):
    wide = np.array([1.0, 0.5])
    both = {"dof_pos": torch.tensor(POSITION[:, None] * wide), "des_dof_pos": torch.tensor(COMMAND[:, None] * wide)}
    more = {"joint_names": ["hip", "knee"], "pd_torque": torch.zeros(60, 2), "rate": 400.0}
    torch.save(both | more | {"time": torch.tensor(TIME)[:, None]}, tmp_path / "chirp.pt")
    torch.save({"mean": torch.zeros(3)}, tmp_path / "mean_000.pt")
    one = read(tmp_path, "pace", "knee")
    np.testing.assert_allclose(one.position[:, 0], 0.5 * POSITION)
    assert one.notes == ("left out, for it is no recording: mean_000.pt",)
    torch.save({key: value.tolist() for key, value in both.items()} | {"time": TIME.tolist()}, tmp_path / "chirp.pt")
    np.testing.assert_allclose(read(tmp_path, "pace", "joint_0").command[:, 0], COMMAND)


COUNTS = np.round(600 * POSITION)


def lerobot(
    root: Path, names: object, action: object = None, robot: str | None = "so101_follower", *,
    state: np.ndarray, command: np.ndarray, files: str = "data/chunk-000/episode_{:06d}.parquet",
) -> Path:  # fmt: skip
    """Two episodes, in a file each or both in one, whose time stamps begin anew."""
    (root / "meta").mkdir(parents=True, exist_ok=True)
    features = {"action": {"names": action or names}, "observation.state": {"names": names}, "index": {"names": None}}
    (root / "meta" / "info.json").write_text(json.dumps({"robot_type": robot, "features": features}))
    pl.DataFrame({"task": ["x"]}).write_parquet(root / "meta" / "tasks.parquet")
    frames = pl.DataFrame(
        {
            "action": command,
            "observation.state": state,
            "episode_index": np.repeat([0, 1], 30),
            "task_index": 0,
            "timestamp": np.tile(TIME[:30], 2).astype(np.float32),
        }
    )
    for episode in (0, 1):
        file = root / files.format(episode)
        file.parent.mkdir(parents=True, exist_ok=True)
        part = frames if file.name == "file-000.parquet" else frames.filter(pl.col("episode_index") == episode)
        part.write_parquet(file)
    return root


@pytest.mark.parametrize("files", ["data/chunk-000/file-000.parquet", "data/chunk-000/episode_{:06d}.parquet"])
@pytest.mark.parametrize(
    "names",
    [
        ["pan.pos", "lift.pos", "gripper.pos"],
        {"motors": ["pan", "lift", "gripper"]},
        [["pan", "lift", "gripper"]],
        {"gripper": 2, "pan": 0, "lift": 1},
    ],
)
def test_units_of_lerobot_are_told_by_the_counts_of_the_encoder(names, files, tmp_path):
    """One joint in degrees, one in -100..100 of 1500 counts, a gripper in per cent of 1500."""
    units = np.stack([COUNTS * 360 / 4095, COUNTS * 200 / 1500, 50 + COUNTS * 100 / 1500], axis=1)
    state = units.astype(np.float32)
    lerobot(tmp_path, names, state=state, command=np.roll(state, 1, axis=0) + 0.013, files=files)
    first, second = read_source([tmp_path], "lerobot", "", [])
    assert first.joints == ("pan", "lift", "gripper")
    assert (len(first.time_s), second.name, second.time_s[0]) == (30, "episode_000001", 0)
    turned = np.diff(np.concatenate([first.position, second.position]), axis=0)
    np.testing.assert_allclose(turned, np.diff(COUNTS)[:, None] * [1, 1, 1] / 4096 * 2 * np.pi, rtol=1e-3, atol=1e-5)
    assert first.notes == ("one unit, by counts of 1/4096 of a turn: pan 0.9998°, lift 0.6592°, gripper 1.318°",)


def test_units_of_other_robots_are_guessed_and_said(tmp_path):
    state = np.stack([100 * POSITION, 40 * POSITION, 50 + 50 * POSITION], axis=1)
    lerobot(tmp_path, ["a", "b", "gripper"], robot="xarm", state=state, command=state + 0.1)
    one = read_source([tmp_path], "lerobot", "", [])[0]
    assert one.notes == (
        "taken as degrees: a, b, gripper; if they are shares of a range, say which column is what with map=",
    )
    np.testing.assert_allclose(one.position[:, 0], np.deg2rad(100 * POSITION[:30]))
    np.testing.assert_allclose(one.command, one.position + np.deg2rad(0.1))
    lerobot(tmp_path, ["a", "b", "gripper"], robot="so101", state=np.round(state, 2), command=state)  # hundredths
    assert read_source([tmp_path], "lerobot", "", [])[0].notes == one.notes
    lerobot(tmp_path, None, robot=None, state=np.array(POSITION), command=np.array(COMMAND))  # one number is no list
    one = read_source([tmp_path], "lerobot", "", [])[0]
    assert (one.joints, one.notes[-1]) == (("joint_0",), "positions are taken as radians")
    np.testing.assert_allclose(one.command[:, 0], COMMAND[:30])


def test_lerobot_takes_the_joints_that_are_in_action_and_state(tmp_path):
    state = np.stack([POSITION, 0.2 * POSITION, TIME], axis=1)
    command = np.stack([0.2 * COMMAND, TIME, COMMAND, TIME], axis=1)
    names, action = ["hip.pos", "knee.pos", "x.vel"], ["knee.pos", "x.vel", "hip.pos", "toe.pos"]
    lerobot(tmp_path, names, action, "biped", state=state, command=command)
    one = read_source([tmp_path], "lerobot", "", [])[0]
    assert one.joints == ("hip", "knee")
    np.testing.assert_allclose(one.command, COMMAND[:30, None] * [1, 0.2])
    assert one.notes[0] == "skipped, for they are no positions in action and state: x.vel, toe"
    command = command[:, :2]
    lerobot(tmp_path, ["hip", "knee"], ["delta_x", "delta_y"], state=state[:, :2], command=command)
    refused(tmp_path, "lerobot", "an action is delta_x, delta_y, and a state hip, knee: none is in both; say .* map=")
    lerobot(tmp_path, None, state=state, command=command)
    refused(tmp_path, "lerobot", "an action has 2 numbers, and a state 3, without names; .*map=")


def test_a_map_reads_lists_of_lerobot_and_episodes_of_two_datasets_are_told_apart(tmp_path):
    state = np.stack([100 * POSITION, 100 * POSITION], axis=1)
    for name in ("a", "b"):
        lerobot(tmp_path / name / "x", None, state=state, command=state + 3)
    (tmp_path / "map.yaml").write_text(
        "time: timestamp\njoints: ['1']\ncommand: {column: 'action[{joint}]', unit: deg, scale: 0.7}\n"
        "position: {column: 'observation.state[{joint}]', unit: deg, scale: 0.7}\nrecording: episode_index\n"
    )
    one, _ = read_source([tmp_path / "a" / "x" / "data" / "chunk-000"], "", str(tmp_path / "map.yaml"), [])
    np.testing.assert_allclose(one.position[:, 0], np.deg2rad(70 * POSITION[:30]))
    found = read_source([tmp_path / "a", tmp_path / "b"], "lerobot", "", ["joint_0"])
    assert [one.name for one in found] == [f"{name}_x_episode_{i:06d}" for name in "ab" for i in (0, 1)]
