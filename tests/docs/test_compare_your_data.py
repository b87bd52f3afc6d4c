"""docs/compare-your-data.md does what it says: its commands run in order, its files and messages are right."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
import yaml
from doc_pages import PAGES, blocks, unpack

from forcegrasp.cli.main import main
from forcegrasp.effects.law import read_law
from forcegrasp.errors import MeasurementError
from forcegrasp.measure import check_set, read_set, write_set
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.replay.record import record
from tests.one_fit import fit_each_set_once

#: In the command that has the first → the second: a small set, few rivals, hardly any training.
SMALLER = {
    "grasps=": "grasps=6",
    "objects=": "objects=1",
    "policies=": "policies=[runs/better]",
}
MORE = {
    "diagnose": ["effects=[backlash,force_deadzone]"],
    "train": ["ppo.total_frames=240", "ppo.grasps=8", "grasp.steps=30", "log.video_every=0", "log.figures_every=0"],
    "evaluate": ["trials=2", "kappas=1", "physics=fast", "grasp.steps=30"],
}
SECONDS = 2.4


PAGE = "docs/compare-your-data.md"


@pytest.fixture(scope="module")
def text() -> str:
    return PAGES[PAGE]


@pytest.fixture
def files(tmp_path, monkeypatch) -> Path:
    """A working folder with the files of the page."""
    unpack(PAGE, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def commands() -> list[list[str]]:
    lines = (line for block in blocks(PAGE, "sh") for line in block.code.splitlines())
    return [words for line in lines if (words := shlex.split(line, comments=True))]


def python(what: str) -> str:
    """The Python block that says this."""
    (code,) = (block.code for block in blocks(PAGE, "python") if what in block.code)
    return code


def shorten(folder: Path) -> None:
    """Keeps the first seconds of each grasp."""
    path = folder / "samples.csv"
    with open(path, newline="") as file:
        head, *rows = csv.reader(file)
    with open(path, "w", newline="") as file:
        csv.writer(file).writerows([head, *(row for row in rows if float(row[head.index("t_s")]) < SECONDS)])


@pytest.mark.long
def test_the_loop_runs_as_written(text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # reports are drawn in tests/cli/test_measuring_verbs.py, evaluations in tests/evaluate
    monkeypatch.setattr("forcegrasp.reports.html._svg", lambda figure: "")
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda self, path, **kwargs: Path(path).touch())
    fit_each_set_once(monkeypatch)
    printed = {}
    for program, verb, *options in commands():
        assert program == "forcegrasp"
        if re.search("simple|monday", " ".join(options)):
            continue  # further sets show nothing else that could break; two copies are in tests/importers
        small = [next((new for key, new in SMALLER.items() if o.startswith(key)), o) for o in options]
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            assert main([verb, *small, *MORE.get(verb, [])]) == 0, f"{verb} {small}"
        printed[verb] = out.getvalue()
        if verb == "record":
            shorten(Path("my_set"))
    found = json.loads(Path("runs/why/diagnosis.json").read_text())
    assert (found["verdict"], found["effects"]) == ("effect", ["backlash"])
    before, after = (json.loads(Path(f"runs/{name}/compare.json").read_text()) for name in ("where", "after"))
    assert after["floor_ratio"] < 1.05 < before["floor_ratio"]
    gap = yaml.safe_load(Path("better.yaml").read_text())["effects"]["backlash"]["gap_m"]
    assert gap["value"] == pytest.approx(0.0006, rel=0.15)
    assert Path("runs/policies/trials.csv").is_file()
    assert "better.yaml" in Path("runs/better/config.yaml").read_text()
    for name in ("where", "why", "after"):
        assert Path(f"runs/{name}/report.html").is_file()
    # what the page says is in the JSON files is there, and nothing else is
    for pattern in ("after/compare", "fit_*/fit", "why/diagnosis", "add_*/add"):
        (path,) = Path("runs").glob(f"{pattern}.json")
        row = next(line for line in text.splitlines() if line.startswith(f"| `{path.name}` |"))
        top = re.findall(r"`(\w+)`", re.sub(r"\([^)]*\)", "", row.split("|")[2]))
        assert top == list(json.loads(path.read_text())), pattern


def test_what_the_page_shows_is_there(text, root):
    shown = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", text)
    assert len(shown) >= 6
    assert all((root / "docs" / picture).is_file() for picture in shown)
    outputs = [block.code for block in blocks(PAGE, "text")]
    assert len(outputs) >= 7
    assert all(output.strip() for output in outputs)


def test_bag_is_converted_as_the_page_says(files):
    rosbag1 = pytest.importorskip("rosbags.rosbag1")
    from rosbags.typesys import Stores, get_typestore

    measured = recorded(grasps=2)
    store = get_typestore(Stores.ROS1_NOETIC)
    types, zero = store.types, np.zeros(0)
    header = types["std_msgs/msg/Header"](0, types["builtin_interfaces/msg/Time"](0, 0), "")
    vector = types["geometry_msgs/msg/Vector3"]
    names = ["arm_1_joint", "gripper_left_finger_joint", "gripper_right_finger_joint"]

    def joints(q):
        return types["sensor_msgs/msg/JointState"](header, names, np.array([1.0, *q]), zero, zero)

    def wrench(force):
        whole = types["geometry_msgs/msg/Wrench"](vector(0.0, 0.0, -force), vector(0.0, 0.0, 0.0))
        return types["geometry_msgs/msg/WrenchStamped"](header, whole)

    def both(values):
        layout = types["std_msgs/msg/MultiArrayLayout"]([], 0)
        return types["std_msgs/msg/Float64MultiArray"](layout, np.array(values))

    messages = [(0.0, "/joint_states", joints((0.045, 0.045)))]
    for index, grasp in enumerate(measured.grasps):
        for at, command, q, f in zip(grasp.time_s, grasp.command_m, grasp.position_m, grasp.force_n, strict=True):
            topics = ("/joint_states", "/tactile/left", "/tactile/right", "/gripper/command")
            sent = zip(topics, (joints(q), wrench(f[0]), wrench(f[1]), both(command)), strict=True)
            messages += [(10 * index + 0.5 + at + 1e-6 * k, *message) for k, message in enumerate(sent)]
    with rosbag1.Writer(files / "pick.bag") as bag:
        kinds = {topic: message.__msgtype__ for _, topic, message in messages}
        known = {topic: bag.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}
        for at, topic, message in messages:
            bag.write(known[topic], 10**11 + round(1e9 * at), store.serialize_ros1(message, kinds[topic]))
    exec(compile(python("convert_bag"), PAGE, "exec"), {})
    converted = read_set("my_bag_set")
    assert [g.object for g in converted.grasps] == ["sponge", "sponge"]
    for grasp, original in zip(converted.grasps, measured.grasps, strict=True):
        assert grasp.position_m == pytest.approx(original.position_m, abs=1e-9)
        assert grasp.force_n == pytest.approx(original.force_n, abs=1e-9)


def test_law_of_the_page_can_be_read(files):
    law = read_law(files / "quadratic_drag.yaml", load_gripper("tiago"))
    assert law.formula == "F' = F + drag * abs(velocity) * velocity"


def test_commands_of_the_page_can_be_played():
    made: dict = {}
    exec(compile(python("make_command"), PAGE, "exec"), made)
    assert made["command"].shape == (150, 2)
    assert made["command"].max() == 0.045
    assert made["command"].min() == pytest.approx(0.022)


def recorded(grasps: int, objects: int = 1):
    made = record(
        load_gripper("tiago"), "rich", grasps=grasps, objects=objects, effects=[], known={},
        off_nominal=0.1, position_std_m=2.7e-5, force_std_n=0.013, seed=3,
    )  # fmt: skip
    return made.measured


def _column(name, change):
    def edit(head, rows):
        at = head.index(name)
        for index, row in enumerate(rows):
            row[at] = change(index, float(row[at]))

    return edit


def _swapped(head, rows):
    for left, right in (("q_l_m", "q_r_m"), ("f_l_n", "f_r_n")):
        a, b = head.index(left), head.index(right)
        for row in rows:
            row[a], row[b] = row[b], row[a]


MISTAKES = {
    "millimetres": _column("q_l_m", lambda i, q: 1000 * q),
    "milliseconds": _column("t_s", lambda i, t: 1000 * t),
    "time that runs back": _column("t_s", lambda i, t: 0.04 if i == 6 else t),
    "no number": _column("f_l_n", lambda i, f: "nan" if i == 6 else f),
    "opening and closing confused": _column("q_l_m", lambda i, q: 0.045 - q),
    "forces of the wrong sign": _column("f_l_n", lambda i, f: -f),
    "left and right swapped": _swapped,
    "a sensor that is stuck": _column("f_l_n", lambda i, f: 0.37),
}


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("sound") / "set"
    write_set(recorded(20, 3), folder, "csv")
    return folder


@pytest.mark.parametrize("mistake", MISTAKES)
def test_messages_are_as_quoted(text, sound, tmp_path, mistake):
    quoted = dict(re.findall(r"^\| ([^|`]+) \| `([^`]+)` \|$", text, re.MULTILINE))
    folder = tmp_path / "set"
    folder.mkdir()
    for file in sound.iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    with open(folder / "samples.csv", newline="") as file:
        head, *rows = csv.reader(file)
    MISTAKES[mistake](head, rows)
    with open(folder / "samples.csv", "w", newline="") as file:
        csv.writer(file).writerows([head, *rows])
    with pytest.raises(MeasurementError) as caught:
        check_set(read_set(folder), 0.045)
    assert quoted[mistake] in str(caught.value)
