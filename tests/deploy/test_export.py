"""forcegrasp export: what it writes, what it tells, and what it refuses."""

from __future__ import annotations

import json
import shutil
import sys

import numpy as np
import pytest
import torch

from forcegrasp.cli.main import main
from forcegrasp.config import GraspConfig, TrainConfig
from forcegrasp.deploy import GraspController
from forcegrasp.errors import DeployError
from forcegrasp.runs import export
from forcegrasp.runs.export import contract_of


@pytest.fixture(scope="module")
def run(make_run):
    return make_run()[0]


@pytest.fixture
def same_network(exported, monkeypatch):
    """Spares torch's exporter: the runs here have the weights that were exported already."""
    network = (exported / "policy.onnx").read_bytes()
    monkeypatch.setattr(export, "to_onnx", lambda *_: (network, {}))


def test_command(run, same_network, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["export", str(run), "out=folder", "ceiling_n=0.9"]) == 0
    out, err = capsys.readouterr()
    assert not err
    first, second, third = out.splitlines()
    assert first == (
        "folder: policy.onnx and contract.json (tiago, 25 Hz, goal 0.08 to 1.425 N, at most 3 mm a step, ceiling 0.9 N)"
    )
    assert second.startswith("acts like the policy in torch: to ")
    assert third.startswith("a step takes ")
    controller = GraspController.load("folder")
    assert controller.contract.ceiling_n == 0.9
    assert json.loads((tmp_path / "folder/contract.json").read_text())["source"]["policy"] == "run"


def test_a_run_of_a_sweep_may_be_called_like_an_option(run, same_network, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(run, "seed=0")
    assert main(["export", "seed=0", "out=folder"]) == 0
    assert json.loads((tmp_path / "folder/contract.json").read_text())["source"]["policy"] == "seed=0"


def test_exports_of_one_policy_are_the_same_file(run, exported, tmp_path):
    export.export_policy(run, tmp_path / "again")
    assert (tmp_path / "again/policy.onnx").read_bytes() == (exported / "policy.onnx").read_bytes()
    assert (tmp_path / "again/contract.json").read_bytes() == (exported / "contract.json").read_bytes()


def test_network_that_acts_differently_is_not_written(make_run, same_network, tmp_path, capsys):
    """A guard against faults of the exporter; here, the network of another policy."""
    run, _ = make_run(seed=1)
    torch.manual_seed(1)
    from forcegrasp.runs.policy import load_policy

    policy, config = load_policy(run)
    with torch.no_grad():
        policy[0].module[0].net[-1].bias.add_(0.01)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(export, "load_policy", lambda _: (policy, config))
        assert main(["export", str(run), f"out={tmp_path / 'out'}"]) == 2
    assert "acts differently (0.01)" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("missing", ["onnx", "onnxscript", "onnxruntime"])
def test_missing_extra(missing, run, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, missing, None)
    assert main(["export", str(run), f"out={tmp_path / 'out'}"]) == 2
    err = capsys.readouterr().err
    assert err == "forcegrasp: exporting a policy needs an extra: pip install 'forcegrasp[onnx]'\n"
    assert not (tmp_path / "out").exists()


def test_ceiling_below_every_goal(make_run, tmp_path, capsys):
    run, _ = make_run(grasp=GraspConfig(goal_force_min_n=0.2))
    assert main(["export", str(run), f"out={tmp_path / 'out'}", "ceiling_n=0.1"]) == 2
    assert "must lie between the smallest goal, 0.14" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("grasp", "expected"),
    [
        (GraspConfig(), (0.08, 1.425)),
        (GraspConfig(kappa=[0.5, 0.5]), (0.08, 0.95 * 0.30 * 2.75)),
        (GraspConfig(goal_force_min_n=0.5), (0.95 * 0.30 * 0.5, 1.425)),  # soft objects can't take more
        (GraspConfig(goal_force_min_n=5.0, kappa=[0.0, 0.0]), (1.425, 1.425)),
    ],
)
def test_goals_are_those_that_training_draws(grasp, expected, draw):
    contract = contract_of(TrainConfig(grasp=grasp), 2.0)
    assert contract.goal_range_n == pytest.approx(expected)
    goals = draw(2000, **vars(grasp)).goal_force_n
    assert np.all((goals >= contract.goal_range_n[0]) & (goals <= contract.goal_range_n[1]))


def test_force_pi_of_a_gripper_of_ones_own(one_sensor, tmp_path, capsys, monkeypatch):
    """Without a network, and so without the packages that one needs."""
    monkeypatch.setitem(sys.modules, "onnx", None)
    out = tmp_path / "hand"
    assert main(["export", "force_pi", f"gripper={one_sensor}", f"out={out}", "ceiling_n=1.8"]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first == (
        f"{out}: contract.json (one_sensor, 25 Hz, goal 0.08 to 1.425 N, at most 3 mm a step, ceiling 1.8 N)"
    )
    assert second.startswith("a step takes ")
    assert [path.name for path in out.iterdir()] == ["contract.json"]
    controller = GraspController.load(out, gripper=out)
    assert controller.contract.gripper.forces == ("f_l_n",)
    assert GraspController.baseline(gripper=out, kp=0.3).policy.gains.kp == 0.3
    with pytest.raises(DeployError, match=r"made for one_sensor \(2 positions and 1 force: q_l_m, q_r_m, f_l_n\)"):
        GraspController.load(out, gripper="tiago")


def test_force_pi_of_the_papers_gripper_by_default(tmp_path):
    export.export_policy("force_pi", tmp_path / "out")
    assert GraspController.load(tmp_path / "out").contract == GraspController.baseline().contract


def test_gripper_beside_a_run(run, tmp_path, capsys):
    assert main(["export", str(run), "gripper=franka_hand", f"out={tmp_path / 'out'}"]) == 2
    assert capsys.readouterr().err.endswith("run was trained on tiago; leave gripper= out\n")
    assert not (tmp_path / "out").exists()


def test_gripper_without_force_readings(one_sensor, tmp_path, capsys):
    text = one_sensor.read_text().replace(", force_sensor: force_l}", "}")
    (one_sensor.parent / "none.yaml").write_text(text)
    assert main(["export", "force_pi", f"gripper={one_sensor.parent / 'none.yaml'}", f"out={tmp_path / 'out'}"]) == 2
    assert "a policy that controls forces must read some" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_limits_follow_from_the_gripper():
    """Those of the paper's gripper are what they were chosen to be; an effort is read with both signs."""
    contract = contract_of(TrainConfig())
    assert (contract.ceiling_n, contract.position_reading_m) == (2.0, (-0.002, 0.047))
    assert (contract.force_reading_n, contract.gap_s, contract.stall) == ((-1.0, 20.0), (0.02, 0.1), None)
    effort = contract_of(TrainConfig(gripper="so101_gripper"))
    assert effort.force_reading_n[0] == -effort.force_reading_n[1] < -effort.ceiling_n
    assert effort.stall == pytest.approx(0.002)
