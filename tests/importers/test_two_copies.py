"""Two copies of a servo, from their logs to what differs between them: by the verb, and in Python."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

import forcegrasp as fg
from forcegrasp.api import CompareResult
from forcegrasp.cli.main import main
from forcegrasp.identify.predict import predict
from forcegrasp.identify.problem import Problem
from forcegrasp.importers.example import COUNT_RAD, example_set
from forcegrasp.measure import write_servo_set
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.replay.replay import Replay

JAW, NAMES = load_gripper("so101_jaw"), ("steps", "ramp", "sine")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """``recorded(name, seed, gain)``: a set of the shipped jaw with another servo gain, and the noise of a seed."""
    folder, example = tmp_path_factory.mktemp("copies"), example_set()
    bare = [
        dataclasses.replace(one, start=(one.command_m[0], np.zeros(1))) for one in example.grasps if one.name in NAMES
    ]
    problem, replay = Problem(JAW, bare), Replay(JAW, bare, encoders_known=False)

    def record(name: str, seed: int, gain: float = 1.0) -> Path:
        nominal = [e.start * (gain if e.parameter == "position_gain" else 1.0) for e in problem.entries]
        vector = [e.coordinate(value) for e, value in zip(problem.entries, nominal, strict=True)]
        read = predict(replay, [problem.case(np.array(vector))])[0]
        noisy = read + 0.3 * COUNT_RAD * np.random.default_rng(seed).standard_normal(read.shape)
        rounded = np.round(noisy / COUNT_RAD) * COUNT_RAD
        found = tuple(dataclasses.replace(one, position_m=rounded[i], start=None) for i, one in enumerate(bare))
        return write_servo_set(dataclasses.replace(example, grasps=found), folder / name)

    return record


@pytest.mark.long
def test_the_gain_of_the_second_copy_is_all_that_differs(recorded, tmp_path, capsys):
    sets = [recorded("first", 1), recorded("second", 2, gain=1.1)]
    assert main(["compare", *map(str, sets), f"out={tmp_path}"]) == 0
    printed = capsys.readouterr().out
    (line,) = [line for line in printed.splitlines() if line.startswith("between the sets")]
    assert line.startswith("between the sets: the sets differ in position_gain (")
    assert "no difference was found in 1 other parameter" in line
    assert f"next: diagnose first by itself, for position_gain differs: forcegrasp diagnose data={sets[0]}" in printed
    found = json.loads((tmp_path / "compare.json").read_text())["between_sets"]["parameters"]
    # the read-out skew is each recording's own
    assert {name: one["agreement"] for name, one in found.items()} == {"position_gain": "differs", "damping": "shared"}
    assert found["position_gain"]["ratios"]["second"]["value"] == pytest.approx(1.1, rel=0.01)
    assert "Between the sets" in (tmp_path / "report.html").read_text()


def test_two_copies_that_are_alike_differ_in_nothing(recorded):
    result = fg.compare([recorded("third", 3), recorded("fourth", 4)])
    assert isinstance(result, CompareResult)
    between = result.to_dict()["between_sets"]
    assert {one["agreement"] for one in between["parameters"].values()} == {"shared"}
    assert any(section.title == "Between the sets" for section in result.sections())


def test_one_set_has_nothing_to_be_compared_with(recorded):
    result = fg.compare(recorded("alone", 5))
    assert isinstance(result, CompareResult)
    assert result.comparison.between is None
    assert not any(section.title == "Between the sets" for section in result.sections())
