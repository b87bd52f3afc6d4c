"""Training with gripper=: every shipped one trains and resumes; what can't be trained is refused, nothing written."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from forcegrasp.cli.main import main
from forcegrasp.gpu import installation
from forcegrasp.physics.gripper_file import load_gripper, shipped_folder, shipped_grippers
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.loop import Trainer, train

BUDGET = {"total_frames": 180, "critic": "privileged", "epochs": 1}
TINY = ["grasp.steps=20", "ppo.grasps=2", "ppo.total_frames=40", "ppo.hidden=[4]", "physics.threads=1"]
QUIET = ["log.histograms_every=0", "log.figures_every=0", "log.video_every=0"]


@pytest.mark.parametrize("name", shipped_grippers())
def test_a_tiny_run_trains_and_resumes_bit_for_bit(name, tiny, tmp_path, monkeypatch):
    config = tiny(gripper=name, ppo=BUDGET, log={"checkpoint_every": 1, "keep": 9})
    whole = RunDir.create(tmp_path / "whole", config, [])
    assert train(config, whole)
    run = RunDir.create(tmp_path / "resumed", config, [])
    first = Trainer.collect

    def stops(trainer: Trainer):
        if trainer.batches == 1:
            raise KeyboardInterrupt
        return first(trainer)

    with monkeypatch.context() as patch:
        patch.setattr(Trainer, "collect", stops)
        with pytest.raises(KeyboardInterrupt):
            train(config, run)
    assert train(run.config(), run, resume=True)
    last = [max(r.checkpoints.glob("frames_*.safetensors")) for r in (whole, run)]
    assert last[0].name == last[1].name
    assert last[0].read_bytes() == last[1].read_bytes()


def written(folder: Path) -> list[Path]:
    return list(folder.rglob("*"))


@pytest.mark.parametrize("more", [[], ["-m", "seed=0,1"]], ids=["run", "sweep"])
def test_an_unknown_gripper_is_refused_with_the_closest(more, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["train", "gripper=franka_hnd", *more]) == 2
    message = capsys.readouterr().err.strip().splitlines()
    assert len(message) == 1
    assert "gripper=franka_hnd: no such gripper" in message[0]
    assert "franka_hand" in message[0]
    assert written(tmp_path) == []


def test_a_gripper_without_forces_is_refused(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for suffix in (".xml", ".yaml"):
        text = (shipped_folder() / f"so101_gripper{suffix}").read_text().replace("force: motor", "force: none")
        Path(f"so101_gripper{suffix}").write_text(text)
    before = set(written(tmp_path))
    assert main(["train", "gripper=so101_gripper.yaml"]) == 2
    message = capsys.readouterr().err.strip().splitlines()
    assert len(message) == 1
    assert "must read some, and this description has none; give a finger a force_sensor" in message[0]
    assert set(written(tmp_path)) == before


def test_warp_says_which_grippers_it_takes(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(installation, "find_spec", lambda name: name)  # as if it were installed
    assert main(["train", "gripper=franka_hand", "physics=warp", "physics.device=cpu"]) == 2
    message = capsys.readouterr().err.strip().splitlines()
    assert len(message) == 1
    assert "does not take gripper franka_hand; it takes two motors that slide a finger each" in message[0]
    assert written(tmp_path) == []


@pytest.mark.parametrize(
    ("option", "reason"),
    [
        ("grasp.deformation_m=0.012", "the smallest radius must exceed grasp.deformation_m=0.012"),
        ("grasp.radius_m=[0.02,0.05]", "takes radii below 0.04"),
        ("grasp.b2=[-9,-6]", "bounds of velocity_gain of franka_hand"),
    ],
)
def test_options_that_do_not_fit_the_gripper_are_refused(option, reason, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["train", "gripper=franka_hand", option]) == 2
    message = capsys.readouterr().err.strip().splitlines()
    assert len(message) == 1
    assert reason in message[0]
    assert written(tmp_path) == []


def test_a_run_says_its_gripper_and_holds_every_number(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["train", "gripper=franka_hand", *TINY, *QUIET]) == 0
    (folder,) = Path("runs").iterdir()
    assert folder.name.endswith("_ib_franka_hand_s0")
    config, training = yaml.safe_load((folder / "config.yaml").read_text()), load_gripper("franka_hand").training
    assert config["gripper"] == "franka_hand"
    assert config["grasp"]["radius_m"] == list(training.radius_m)
    assert config["sensors"]["force_std_n"] == training.force_std_n
    assert config["action"]["max_delta_m"] == load_gripper("franka_hand").max_step
    assert config["curriculum"]["offset_m"] == list(training.start_offset_m)
