"""A folder that was exported, damaged in every way: one line that says what is wrong."""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from forcegrasp.deploy import GraspController
from forcegrasp.deploy.contract_file import read_contract, shipped_contracts
from forcegrasp.errors import DeployError
from forcegrasp.physics.gripper_file import shipped_grippers
from tools.deploy_contracts import write_contracts


@pytest.fixture
def folder(exported, tmp_path) -> Path:
    return Path(shutil.copytree(exported, tmp_path / "policy"))


def refusal(folder: Path) -> str:
    with pytest.raises(DeployError) as caught:
        GraspController.load(folder)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_what_was_exported(exported):
    content = json.loads((exported / "contract.json").read_text())
    contract, network = read_contract(exported)
    assert contract.goal_range_n == pytest.approx((0.08, 1.425))
    assert content["network"]["input"]["shape"] == [1, 30]
    assert list(content["network"]["input"]["parts"]) == list(contract.parts)
    assert content["network"]["sha256"] == hashlib.sha256(network).hexdigest()
    assert {"forcegrasp", "torch", "onnx"} <= set(content["source"]["versions"])
    for text in (network, (exported / "contract.json").read_bytes()):
        assert str(Path(__file__).parents[2]).encode() not in text  # nothing of the machine that exported
    assert sorted(path.name for path in exported.iterdir()) == ["contract.json", "policy.onnx"]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda c: c.update(format="forcegrasp-policy/3"), "format is 'forcegrasp-policy/3', but this version reads"),
        (lambda c: c.update(format=1), "format is missing or not a str"),
        (lambda c: c.pop("format"), "format is missing"),
        (lambda c: c.pop("network"), "network is missing"),
        (lambda c: c["network"].update(sha256="0" * 64), "policy.onnx: not the network that contract.json"),
        (lambda c: c.update(policy="net"), "policy is 'net', but must be network or force_pi"),
        (lambda c: c.update(policy="force_pi"), "gains is missing or not a dict"),
        (lambda c: c.pop("gripper"), "gripper is missing or not a dict"),
        (lambda c: c["gripper"].pop("name"), "gripper: name is missing"),
        (lambda c: c["gripper"].update(name=2), "gripper: name=2: must be text"),
        (lambda c: c["gripper"].update(unit="mm"), "unit='mm': must be m or rad"),
        (lambda c: c["gripper"].update(forces=[]), "forces=[]: must name each reading once, and at least one"),
        (lambda c: c["gripper"].update(forces=["f_n", "f_n"]), "must name each reading once"),
        (lambda c: c["gripper"].update(positions="q_m"), "gripper: positions='q_m': must be a list of names"),
        (
            lambda c: c["gripper"].update(positions=["q_m"]),
            "but its contract says [('observation', 'tensor(float)', [1, 24])",
        ),
        (lambda c: c["control"].pop("stall"), "control: stall is missing"),
        (lambda c: c["control"].update(stall="never"), "stall='never': must be a number, or null"),
        (lambda c: c["control"].update(stall=0), "stall=0: must be positive"),
        (lambda c: (c["control"].update(stall=1.0), c["gripper"].update(forces=["f_n"])), "a force reading per motor"),
        (lambda c: c.update(control=[]), "control is missing or not a dict"),
        (lambda c: c["control"].pop("frames"), "control: frames is missing"),
        (lambda c: c["control"].update(frame=3), "no entry 'frame'; did you mean frames?"),
        (lambda c: c["control"].update(frames=0), "frames=0: must be at least 1"),
        (lambda c: c["control"].update(frames=2.0), "frames=2.0: must be a whole number"),
        (lambda c: c["control"].update(frames=True), "frames=True: must be a whole number"),
        (lambda c: c["control"].update(frames=2), "but its contract says"),
        (lambda c: c["control"].update(inductive_bias=1), "inductive_bias=1: must be true or false"),
        (lambda c: c["control"].update(bias_floor=1.5), "bias_floor=1.5: must lie in [0, 1]"),
        (lambda c: c["control"].update(max_delta_m=0), "max_delta_m=0: must be positive"),
        (lambda c: c["control"].update(max_delta_m="3 mm"), "max_delta_m='3 mm': must be a number"),
        (lambda c: c["control"].update(max_delta_m=10**400), "policy/contract.json: "),
        (lambda c: c["control"].update(max_delta_m=None), "must be a number"),
        (lambda c: c["control"].update(ceiling_n=float("nan")), "not valid JSON (NaN is no number)"),
        (lambda c: c["control"].update(ceiling_n=0.01), "ceiling_n=0.01: must lie between the smallest goal"),
        (lambda c: c["control"].update(ceiling_n=25.0), "largest reading that can be true, 20 N"),
        (lambda c: c["control"].update(joint_range_m=[0.045, 0.0]), "must be [low, high] with low ≤ high"),
        (lambda c: c["control"].update(joint_range_m=[0.045]), "joint_range_m=[0.045]: must be [low, high]"),
        (lambda c: c["control"].update(joint_range_m=0.045), "joint_range_m=0.045: must be [low, high]"),
        (lambda c: c["control"].update(goal_range_n=[0.0, 1.0]), "must not reach below 0"),
        (lambda c: c["control"].update(parts=["forces"]), "no observation part 'forces'; did you mean force"),
        (lambda c: c["control"].update(parts=["force", "force"]), "once"),
        (lambda c: c["control"].update(parts=[]), "at least one"),
        (lambda c: c["control"].update(parts="force"), "parts='force': must be a list of names"),
    ],
)
def test_damaged_contract(folder, change, told):
    path = folder / "contract.json"
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    assert told in refusal(folder)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (b"", "not valid JSON"),
        (b"{", "not valid JSON"),
        (b"[]", "format is missing"),
        (b"\xff\xfe{}", "not valid JSON"),
        (b"[" * 100_000, "not valid JSON"),
    ],
)
def test_contract_that_is_none(folder, text, told):
    (folder / "contract.json").write_bytes(text)
    assert told in refusal(folder)


def test_files_that_are_missing_or_changed(folder, tmp_path):
    assert "nowhere: not an exported policy" in refusal(tmp_path / "nowhere")
    network = folder / "policy.onnx"
    data = network.read_bytes()
    network.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    assert "policy.onnx: not the network that contract.json was written for" in refusal(folder)
    network.unlink()
    assert "policy.onnx: could not read" in refusal(folder)
    (folder / "contract.json").unlink()
    assert "no contract.json" in refusal(folder)


@pytest.mark.parametrize("data", [b"", b"no network", b"\x08\x07"])
def test_network_that_is_none(folder, data):
    (folder / "policy.onnx").write_bytes(data)
    content = json.loads((folder / "contract.json").read_text())
    content["network"]["sha256"] = hashlib.sha256(data).hexdigest()
    (folder / "contract.json").write_text(json.dumps(content))
    assert "onnxruntime can't load it" in refusal(folder)


def test_nothing_of_the_simulator_is_needed(exported):
    program = f"""
import sys
for name in ("torch", "torchrl", "tensordict", "mujoco", "gymnasium", "hydra", "omegaconf", "scipy", "yaml", "polars",
             "matplotlib", "rich", "safetensors", "pydantic"):
    sys.modules[name] = None  # importing it raises
from forcegrasp.deploy import GraspController
for controller in (GraspController.baseline(), GraspController.load({str(exported)!r}, gripper="tiago")):
    controller.reset(0.5)
    print(controller.step([0.04, 0.04], [0.0, 0.0], 0.0))
"""
    done = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("[0.0") == 2
    assert not done.stderr


def test_without_onnxruntime(exported, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    assert "pip install onnxruntime" in refusal(exported)
    baseline = GraspController.baseline()
    baseline.reset(0.5)
    assert baseline.step([0.04, 0.04], [0.0, 0.0]) == pytest.approx(np.array([0.037, 0.037]))


def test_contract_in_one_line():
    for gripper, told in {
        "tiago": "tiago, 25 Hz, goal 0.08 to 1.425 N, at most 3 mm a step, ceiling 2 N",
        "so101_gripper": "so101_gripper, 25 Hz, goal 0.6524 to 3.873 N, at most 0.02 rad a step, ceiling 5.436 N",
    }.items():
        assert str(GraspController.baseline(gripper=gripper).contract) == told


def test_contract_of_the_first_format(folder):
    """There was one gripper, and nothing was said of it."""
    path = folder / "contract.json"
    content = json.loads(path.read_text())
    expected, _ = read_contract(folder)
    content["format"] = "forcegrasp-policy/1"
    del content["policy"], content["gripper"], content["control"]["stall"], content["network"]["input"]["columns"]
    path.write_text(json.dumps(content))
    controller = GraspController.load(folder, gripper="tiago")
    assert controller.contract == expected
    controller.reset(0.5)
    assert controller.step([0.04, 0.04], [0.0, 0.0]).shape == (2,)


def test_policy_of_another_gripper(exported):
    with pytest.raises(DeployError) as caught:
        GraspController.load(exported, gripper="franka_hand")
    assert str(caught.value) == (
        f"{exported}: made for tiago (2 positions and 2 forces: q_l_m, q_r_m, f_l_n, f_r_n); the robot has franka_hand"
        " (1 position and 2 forces: q_m, f_l_n, f_r_n)"
    )
    with pytest.raises(DeployError, match="made for robotiq_2f85"):  # as many readings, of another kind
        GraspController.load(shipped_contracts() / "robotiq_2f85", gripper="franka_hand")


def test_grippers_that_have_no_contract(exported):
    with pytest.raises(DeployError, match=r"gripper=franka: no such gripper; did you mean franka_hand\?; for one of"):
        GraspController.baseline(gripper="franka")
    with pytest.raises(DeployError, match=r"holds a trained policy, which GraspController\.load runs"):
        GraspController.baseline(gripper=exported)


def test_shipped_contracts_are_those_of_the_descriptions(tmp_path):
    """Else: python tools/deploy_contracts.py."""
    write_contracts(tmp_path)
    assert [path.name for path in sorted(tmp_path.iterdir())] == shipped_grippers()
    for name in shipped_grippers():
        shipped, made = (
            json.loads((at / name / "contract.json").read_text()) for at in (shipped_contracts(), tmp_path)
        )
        for section in ("control", "gains"):
            expected = made.pop(section).items()
            assert shipped.pop(section) == {k: v if k == "parts" else pytest.approx(v) for k, v in expected}
        assert shipped == made


@pytest.mark.parametrize(
    ("gains", "told"),
    [
        ({"stiffness": 0}, "stiffness=0: must be positive"),
        ({"closing_step": "slow"}, "gains: closing_step='slow': must be a number"),
        ({"kd": 1.0}, "gains: no entry 'kd'; did you mean kp or ki?"),
    ],
)
def test_damaged_gains(gains, told, tmp_path):
    folder = Path(shutil.copytree(shipped_contracts() / "tiago", tmp_path / "hand"))
    content = json.loads((folder / "contract.json").read_text())
    content["gains"] |= gains
    (folder / "contract.json").write_text(json.dumps(content))
    assert told in refusal(folder)
