"""What a mapping file makes of a bag's messages, with a double in place of rosbags, which need not be installed."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from forcegrasp.measure import convert_bag

MAPPING = """
bag: a.bag
gripper: tiago
source: here
license: none
clock: qdes_l_m
signals:
  qdes_l_m: {topic: /command, field: "data[0]"}
  qdes_r_m: {topic: /command, field: "data[1]"}
  q_l_m: {topic: /joints, field: "position[name=l.finger]", scale: 0.001, offset: -0.002}
  q_r_m: {topic: /joints, field: "position[name=r]", scale: 0.001}
  f_l_n: {topic: /force, field: "wrench.x", scale: -1}
  f_r_n: {topic: /force, field: "wrench.y", scale: -1}
grasps:
  - {grasp: one, object: sponge, session: a, start_s: 1.0, end_s: 1.5}
  - {grasp: two, object: sponge, session: a, start_s: 2.0, end_s: 2.5}
"""


def messages():
    """(seconds, topic, message): a command every 0.1 s; joints 10 ms before it, forces with it and 10 ms after it."""
    for step in range(30):
        at = 0.1 * step
        yield at, "/joints", SimpleNamespace(name=["arm", "r", "l.finger"], position=[9.0, 30.0 - step, 40.0 - step])
        yield at + 0.01, "/force", SimpleNamespace(wrench=SimpleNamespace(x=-0.1 * step, y=-0.2 * step))
        yield at + 0.01, "/command", SimpleNamespace(data=[0.04, 0.03])
        yield at + 0.02, "/force", SimpleNamespace(wrench=SimpleNamespace(x=99.0, y=99.0))


class Bag:
    """Of rosbags' reader what a conversion needs."""

    start_time = 1_700_000_000_000_000_000

    def __init__(self, paths, default_typestore):
        self.connections = [SimpleNamespace(topic=t, msgtype="some") for t in ("/joints", "/force", "/command", "/tf")]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def messages(self, connections):
        by_topic = {connection.topic: connection for connection in connections}
        for at, topic, message in messages():
            yield by_topic[topic], self.start_time + round(at * 1e9), message

    def deserialize(self, data, kind):
        return data


@pytest.fixture
def grasps(tmp_path, monkeypatch):
    for name, entries in {
        "rosbags": {},
        "rosbags.highlevel": {"AnyReader": Bag},
        "rosbags.typesys": {"Stores": SimpleNamespace(LATEST=0), "get_typestore": lambda store: None},
    }.items():
        module = ModuleType(name)
        vars(module).update(entries)
        monkeypatch.setitem(sys.modules, name, module)
    (tmp_path / "mapping.yaml").write_text(MAPPING)
    return convert_bag(tmp_path / "mapping.yaml").grasps


def test_a_grasp_is_the_commands_between_its_times(grasps):
    np.testing.assert_allclose(grasps[0].time_s, [1.01, 1.11, 1.21, 1.31, 1.41], atol=1e-9)
    np.testing.assert_allclose(grasps[1].time_s, [2.01, 2.11, 2.21, 2.31, 2.41], atol=1e-9)
    np.testing.assert_array_equal(grasps[0].command_m, [[0.04, 0.03]] * 5)


def test_readings_are_scaled_then_shifted(grasps):
    steps = np.arange(10, 15)
    expected = np.stack([0.001 * (40 - steps) - 0.002, 0.001 * (30 - steps)], axis=1)
    np.testing.assert_allclose(grasps[0].position_m, expected, atol=1e-12)


def test_a_reading_is_the_newest_at_or_before_the_command(grasps):
    steps = np.arange(10, 15)
    np.testing.assert_allclose(grasps[0].force_n, np.stack([0.1 * steps, 0.2 * steps], axis=1), atol=1e-12)
