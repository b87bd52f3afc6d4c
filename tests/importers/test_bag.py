"""ROS bags by a map: a sample at each message of the state, with the newest command."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from forcegrasp.errors import MeasurementError
from forcegrasp.importers import read_source

pytest.importorskip("rosbags")
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

TIME = 3.0 + np.arange(60) * 0.01
STATE = np.stack([np.sin(TIME), 0.2 * TIME], axis=1)
MAP = """
joints: [elbow, jaw]
command: {topic: /goal, column: "position[name={joint}]", unit: deg}
position: {topic: /joint_states, column: "position[name={joint}]"}
effort: {topic: /joint_states, column: "effort[name={joint}]", unit: Nm}
"""


def write(path: Path, ros: int) -> Path:
    """A bag in which goals of 50 Hz come a millisecond after every other state of 100 Hz, with other joints beside."""
    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="", **({"seq": 0} if ros == 1 else {}))

    def joints(names, position, effort):
        return types["sensor_msgs/msg/JointState"](header, names, position, np.zeros(0), effort)

    writer = rosbag1.Writer(path / "a.bag") if ros == 1 else rosbag2.Writer(path / "bag", version=9)
    pack = store.serialize_ros1 if ros == 1 else store.serialize_cdr
    with writer:
        state, goal = (
            writer.add_connection(topic, "sensor_msgs/msg/JointState", typestore=store)
            for topic in ("/joint_states", "/goal")
        )
        for index, (at, (elbow, jaw)) in enumerate(zip(TIME, STATE, strict=True)):
            there = joints(["jaw", "other", "elbow"], np.array([jaw, 9.0, elbow]), np.array([0.1 * index, 9.0, -index]))
            writer.write(state, round(at * 1e9), pack(there, there.__msgtype__))
            if index % 2 == 0:
                wanted = joints(["elbow", "jaw"], np.rad2deg([elbow + 0.1, jaw + 0.1]), np.zeros(0))
                writer.write(goal, round(at * 1e9) + 1_000_000, pack(wanted, wanted.__msgtype__))
    return path / ("a.bag" if ros == 1 else "bag")


@pytest.mark.parametrize("ros", [1, 2])
def test_joint_states_and_goals_of_a_bag(ros, tmp_path):
    (tmp_path / "logs").mkdir()
    bag = write(tmp_path / "logs", ros)
    (tmp_path / "map.yaml").write_text(MAP)
    for source in (bag, tmp_path / "logs"):
        (one,) = read_source([source], "", str(tmp_path / "map.yaml"), [])
        assert (one.name, one.joints, one.effort_unit) == (bag.stem, ("elbow", "jaw"), "N·m")
        np.testing.assert_allclose(one.time_s, TIME[1:] - TIME[1], atol=1e-8)  # the first state had no goal before it
        np.testing.assert_allclose(one.position, STATE[1:])
        np.testing.assert_allclose(one.command, np.repeat(STATE[::2] + 0.1, 2, axis=0)[: len(one.command)])
        assert one.effort is not None
        np.testing.assert_allclose(one.effort[:, 0], -np.arange(1, 60))
    (jaw,) = read_source([bag], "", str(tmp_path / "map.yaml"), ["jaw"])
    np.testing.assert_allclose(jaw.position[:, 0], STATE[1:, 1])


def test_what_does_not_fit_a_bag_is_told(tmp_path):
    bag = write(tmp_path, 2)
    for old, new, match in (
        ("topic: /", "topic: /a/", "no topic '/a/goal'.*; /a/joint_states .*no topic '/a/joint_states'"),
        ("elbow, jaw", "ellbow, yaw", r"never 'position\[name=ellbow\]' in /goal; .*\[name=yaw\]' in /joint_states"),
        ("topic: /goal, column", "column", "command.topic: missing; position has one, and a log is a bag or a table"),
    ):
        (tmp_path / "map.yaml").write_text(MAP.replace(old, new))
        with pytest.raises(MeasurementError, match=match):
            read_source([bag], "", str(tmp_path / "map.yaml"), [])
    (tmp_path / "map.yaml").write_text("time: t\njoints: a\ncommand: goal\nposition: pos")
    with pytest.raises(MeasurementError, match="bag: is a bag: each column needs a topic in the map"):
        read_source([bag], "", str(tmp_path / "map.yaml"), [])
