"""A recurrent policy on the robot: what its contract says, and when it remembers and forgets."""

from __future__ import annotations

import json

import numpy as np
import pytest

from forcegrasp.config import ObservationConfig, PPOConfig
from forcegrasp.deploy import GraspController, OnnxPolicy
from forcegrasp.deploy.contract_file import read_contract
from forcegrasp.errors import DeployError
from forcegrasp.runs.export import export_policy

READINGS = ([0.04, 0.041], [0.0, 0.01]), ([0.038, 0.04], [0.0, 0.2]), ([0.037, 0.04], [0.3, 0.25])


@pytest.fixture(scope="module")
def folder(make_run, tmp_path_factory):
    run, _ = make_run(ppo=PPOConfig(hidden=[8], memory=6), observation=ObservationConfig(frames=1))
    export_policy(run, out := tmp_path_factory.mktemp("exported") / "recurrent")
    return out


@pytest.fixture
def controller(folder):
    controller = GraspController.load(folder)
    controller.reset(0.5)
    return controller


def actions(controller: GraspController, readings=READINGS) -> np.ndarray:
    steps = []
    for q, f in readings:
        controller.step(q, f)
        steps.append(controller.action)
    return np.stack(steps)


def test_the_contract_says_how_much_is_remembered(folder, exported):
    content = json.loads((folder / "contract.json").read_text())
    assert content["control"]["memory"] == read_contract(folder)[0].memory == 12  # two of six
    assert content["network"]["memory"] | {"layout": ""} == {
        "input": "memory",
        "output": "next_memory",
        "dtype": "float32",
        "shape": [1, 12],
        "layout": "",
    }
    without = json.loads((exported / "contract.json").read_text())  # as before there were memories
    assert "memory" not in without["control"] | without["network"]
    assert read_contract(exported)[0].memory == 0


def test_a_contract_of_another_memory_is_refused(folder, exported):
    contract, network = read_contract(folder)
    for wrong in (read_contract(exported)[0], type(contract)(**vars(contract) | {"memory": 6})):
        with pytest.raises(DeployError, match="its contract says"):
            OnnxPolicy(network, wrong)
    with pytest.raises(ValueError, match="memory=-1: must not be negative"):
        type(contract)(**vars(contract) | {"memory": -1})


def test_what_was_read_before_counts_until_reset(controller):
    first = actions(controller)
    controller.reset(0.5)
    assert np.array_equal(actions(controller), first)
    again = actions(controller)  # the same readings, remembered otherwise
    assert (np.abs(again - first) > 1e-4).any(1).all()


def test_a_network_that_gives_no_numbers_forgets_nothing(controller):
    actions(controller, READINGS[:2])
    before = controller.policy._memory["memory"].copy()
    assert before.any()
    parts = {part: np.full(1 if part == "goal" else 2, np.nan, np.float32) for part in controller.contract.parts}
    assert not np.isfinite(controller.policy.act(parts)).any()
    assert np.array_equal(controller.policy._memory["memory"], before)
