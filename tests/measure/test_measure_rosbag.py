"""Bags written here with rosbags itself, in ROS 1, ROS 2 and MCAP: a sample at each command, the newest readings."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from measured_rig import OPEN_M

from forcegrasp.errors import MeasurementError
from forcegrasp.measure import check_set, convert_bag, read_set, write_set
from forcegrasp.measure.schema import TWO_FINGERS

rosbags = pytest.importorskip("rosbags")
from rosbags import rosbag1, rosbag2  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

START_NS = 1_700_000_000_000_000_000
KINDS = ("ros1", "ros2", "mcap", "mcap file")


def _messages(grasps):
    """Topics and messages as (seconds, topic, type, fields); two grasps, the second from 10 s on."""
    for number, grasp in enumerate(grasps[:2]):
        for i, t in enumerate(grasp.time_s.tolist()):
            at = 10.0 * number + t + 0.5
            q, f = 1000 * grasp.position_m[i], grasp.force_n[i]
            yield at - 0.004, "/joints", "joints", (["arm", "l.finger", "r"], [9.0, *q])
            yield at - 0.003, "/joints", "joints", (["elbow"], [1.0])
            yield at - 0.002, "/force/left", "wrench", -f[0]
            yield at - 0.001, "/force/right", "wrench", -f[1]
            yield at, "/command", "array", grasp.command_m[i]
            yield at + 0.001, "/force/left", "wrench", 99.0  # after the command: belongs to the next sample, if newest


def _write(path: Path, kind: str, messages) -> Path:
    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    types = store.types
    time = types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    extra = {"seq": 0} if kind == "ros1" else {}
    header = types["std_msgs/msg/Header"](stamp=time, frame_id="", **extra)
    vector, wrench = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Wrench"]
    array, layout = types["std_msgs/msg/Float64MultiArray"], types["std_msgs/msg/MultiArrayLayout"]

    def message(what, data):
        if what == "joints":
            names, positions = data
            none = np.zeros(0)
            return types["sensor_msgs/msg/JointState"](header, names, np.array(positions, float), none, none)
        if what == "wrench":
            force, torque = vector(0.0, 0.0, data), vector(0.0, 0.0, 0.0)
            return types["geometry_msgs/msg/WrenchStamped"](header, wrench(force, torque))
        return array(layout([], 0), np.array(data, float))

    if kind == "ros1":
        writer = rosbag1.Writer(path / "a.bag")
    else:
        plugin = rosbag2.StoragePlugin.SQLITE3 if kind == "ros2" else rosbag2.StoragePlugin.MCAP
        writer = rosbag2.Writer(path / "bag", version=9, storage_plugin=plugin)
    serialize = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr
    with writer:
        known = {}
        for at, topic, what, data in messages:
            filled = message(what, data)
            name = filled.__msgtype__
            if topic not in known:
                known[topic] = writer.add_connection(topic, name, typestore=store)
            writer.write(known[topic], START_NS + round(at * 1e9), serialize(filled, name))
    if kind == "mcap file":
        return next((path / "bag").glob("*.mcap"))
    return path / ("a.bag" if kind == "ros1" else "bag")


MAPPING = """
bag: {bag}
gripper: tiago
source: a bag
license: CC0
force_std_n: 1.3e-2
clock: qdes_l_m
signals:
  qdes_l_m: {{topic: /command, field: "data[0]"}}
  qdes_r_m: {{topic: /command, field: "data[1]"}}
  q_l_m: {{topic: /joints, field: "position[name=l.finger]", scale: 1e-3}}
  q_r_m: {{topic: /joints, field: "position[name=r]", scale: 0.001, offset: 0}}
  f_l_n: {{topic: /force/left, field: wrench.force.z, scale: -1}}
  f_r_n: {{topic: /force/right, field: wrench.force.z, scale: -1}}
grasps:
  - {{grasp: 007, object: wood, session: a, start_s: 0, end_s: 5, object_radius_m: 0.025, split: fit}}
  - {{grasp: two, object: wood, session: a, start_s: 10, end_s: 16, object_radius_m: 0.025, object_offset_m: 0.01,
     object_mass_kg: 0.3}}
"""


@pytest.fixture(scope="module")
def bags(grasps, tmp_path_factory):
    made = {}
    for kind in KINDS:
        made[kind] = _write(tmp_path_factory.mktemp("bags"), kind, _messages(grasps))
    return made


def _mapping(tmp_path: Path, bag: Path, *changes: tuple[str, str]) -> Path:
    text = MAPPING.format(bag=bag)
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file = tmp_path / "bag.yaml"
    file.write_text(text)
    return file


@pytest.mark.parametrize("kind", KINDS)
def test_round_trip(bags, kind, grasps, tmp_path):
    measured = convert_bag(_mapping(tmp_path, bags[kind]))
    assert [grasp.name for grasp in measured.grasps] == ["007", "two"]
    assert measured.force_std_n == 0.013
    assert measured.position_std_m is None
    for was, now in zip(grasps, measured.grasps, strict=False):
        np.testing.assert_allclose(np.diff(now.time_s), np.diff(was.time_s), atol=1e-7)
        np.testing.assert_array_equal(now.command_m, was.command_m)
        np.testing.assert_allclose(now.position_m, was.position_m, atol=1e-15)
        np.testing.assert_array_equal(now.force_n, was.force_n)
    assert check_set(measured, OPEN_M) == []
    written = read_set(write_set(measured, tmp_path / "set"))
    assert written.fingerprint == measured.fingerprint


def test_newest_reading_at_or_before(tmp_path):
    """Held, never interpolated, and a reading at the same instant counts."""
    messages = []
    for i in range(20):
        if i in (0, 5, 6, 15):
            messages += [(0.1 * i, "/joints", "joints", (["l.finger", "r"], [i, -i]))]
        messages += [(0.1 * i, f"/force/{side}", "wrench", float(i)) for side in ("left", "right")]
        messages += [(0.1 * i, "/command", "array", [i, i])]
    bag = _write(tmp_path, "ros2", messages)
    changes = [(MAPPING[MAPPING.index("  - {{grasp: two") : -1].format(), "")]
    grasp = convert_bag(_mapping(tmp_path, bag, *changes)).grasps[0]
    expected = [0] * 5 + [5] + [6] * 9 + [15] * 5
    np.testing.assert_array_equal(np.round(1000 * grasp.position_m[:, 0]), expected)
    np.testing.assert_array_equal(grasp.force_n[:, 0], -np.arange(20.0))


BROKEN = {
    "no topic": ("/force/left", "/force/lft", ["f_l_n", "no topic '/force/lft'", "/force/left"]),
    "no field": ("wrench.force.z", "wrench.force.w", ["f_l_n", "'wrench.force.w'", "header, wrench"]),
    "not a number": ("wrench.force.z", "wrench.force", ["f_l_n", "no number at"]),
    "a whole array": ("data[0]", "data", ["qdes_l_m", "no number at"]),
    "beyond the array": ("data[0]", "data[7]", ["qdes_l_m", "data[7]"]),
    "no such joint": ("name=r]", "name=s]", ["q_r_m", "never"]),
    "no names": ("name=r]", "nam=r]", ["q_r_m", "position[nam=r]"]),
    "odd field": ("wrench.force.z", "wrench/force", ["f_l_n.field", "must look like"]),
    "code for a field": ("wrench.force.z", "__class__.mro()", ["f_l_n.field", "must look like"]),
    "empty field": ("wrench.force.z", "''", ["f_l_n.field"]),
    "scale of 0": ("scale: -1", "scale: 0", ["f_l_n.scale"]),
    "scale of text": ("scale: -1", "scale: minus", ["f_l_n.scale"]),
    "unknown key of a signal": ("scale: -1", "factor: -1", ["factor: unknown"]),
    "unknown signal": ("f_l_n:", "f_left_n:", ["'f_left_n'", "did you mean f_l_n"]),
    "missing signal": ('  qdes_r_m: {topic: /command, field: "data[1]"}\n', "", ["missing keys: qdes_r_m"]),
    "unknown clock": ("clock: qdes_l_m", "clock: qdes_m", ["clock", "did you mean qdes_"]),
    "unknown key": ("license:", "licence:", ["licence: unknown", "license"]),
    "no bag": ("bag: ", "bag: no", ["not a bag"]),
    "grasp without session": ("session: a, start_s: 10", "start_s: 10", ["grasps[1].session: missing"]),
    "unknown key of a grasp": ("object_offset_m", "offset_m", ["grasps[1]", "did you mean object_offset_m"]),
    "split": ("split: fit", "split: test", ["grasps[0]", "not test"]),
    "ends before it starts": ("end_s: 16", "end_s: 9", ["grasps[1]", "after start_s"]),
    "time in words": ("end_s: 16", "end_s: later", ["grasps[1]", "end_s"]),
    "no time": ("end_s: 16", "end_s: ", ["grasps[1]", "end_s"]),
    "outside the bag": ("start_s: 10, end_s: 16", "start_s: 100, end_s: 160", ["grasps[1]", "no message of qdes_l_m"]),
    "same name": ("grasp: two", "grasp: 007", ["grasps[1]", "twice"]),
    "no name": ("grasp: two", "grasp: ''", ["grasps[1]", "grasp"]),
    "radius of 0": ("0.025, split", "0, split", ["grasps[0]", "object_radius_m"]),
    "noise of 0": ("1.3e-2", "0", ["force_std_n"]),
    "grasps no list": ("grasps:\n", "grasps: 3\nx:\n", ["x: unknown"]),
    "a tag": ("clock: qdes_l_m", "clock: !!python/name:os.system x", ["tag"]),
}


@pytest.mark.parametrize("case", BROKEN)
def test_mapping_refused(bags, tmp_path, case):
    old, new, parts = BROKEN[case]
    with pytest.raises(MeasurementError) as caught:
        convert_bag(_mapping(tmp_path, bags["mcap"], (old, new)))
    message = str(caught.value)
    assert message.isprintable()
    for part in parts:
        assert part in message, message


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("share", [0.0, 0.02, 0.5])
def test_cut_bag(bags, tmp_path, kind, share):
    bag = bags[kind]
    if bag.is_dir():
        copy = tmp_path / "bag"
        copy.mkdir()
        for file in bag.iterdir():
            (copy / file.name).write_bytes(file.read_bytes())
        victim = next(file for file in copy.iterdir() if file.suffix in (".mcap", ".db3"))
    else:
        copy = victim = tmp_path / bag.name
        victim.write_bytes(bag.read_bytes())
    victim.write_bytes(victim.read_bytes()[: int(share * victim.stat().st_size)])
    with pytest.raises(MeasurementError) as caught:
        convert_bag(_mapping(tmp_path, copy))
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("data", [b"", b"#ROSBAG V2.0\n", b"\x89MCAP0\r\n", b"SQLite format 3\0", b"\xff\0" * 999])
@pytest.mark.parametrize("name", ["x.bag", "x.mcap", "x.db3", "x"])
def test_no_bag(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(MeasurementError, match="not a bag that can be read") as caught:
        convert_bag(_mapping(tmp_path, tmp_path / name))
    assert str(caught.value).isprintable()


def test_without_the_extra(bags, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with pytest.raises(MeasurementError, match=r"pip install 'forcegrasp\[rosbag\]'"):
        convert_bag(_mapping(tmp_path, bags["ros1"]))


def test_no_mapping(tmp_path):
    with pytest.raises(MeasurementError, match=r"none\.yaml"):
        convert_bag(tmp_path / "none.yaml")


def test_all_signals_are_asked_for():
    assert all(f"  {name}: " in MAPPING for name in TWO_FINGERS.signals[1:])
