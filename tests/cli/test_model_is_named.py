"""A run that was trained with a model says so: in its name, in the hints, in TensorBoard, and when it is evaluated."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path

import pytest

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.cli.main import main
from forcegrasp.cli.options import compose_run
from forcegrasp.config import TrainConfig
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.board import card, evaluate_command

MODEL = Path(__file__).parents[1] / "config" / "model.yaml"  # is said by the name of its folder


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ([], "ib_s0"),
        (["model="], "ib_s0"),
        (["model=better.yaml"], "ib_better_s0"),
        (["model=runs/diagnose_1/model.yaml", "experiment=no_ib", "seed=3"], "no_ib_diagnose_1_s3"),
        (["model='my models/a $b c.yaml'"], "ib_a__b_c_s0"),
        ([f"gripper={DEFAULT_GRIPPER}"], "ib_s0"),
        (["gripper=far/my_hand.yaml"], "ib_my_hand_s0"),
        (["model=a/lag.yaml", "gripper=franka_hand"], "ib_franka_hand_lag_s0"),
    ],
)
def test_name_of_a_run(given, name):
    folder = compose_run("train", given)[1]
    assert re.fullmatch(rf"runs/\d{{4}}-\d\d-\d\d_\d\d-\d\d-\d\d_{name}", folder)


def test_names_of_a_sweeps_runs(tiny, tmp_path, monkeypatch):
    """One after another; those of joblib's processes are in test_sweep.py."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", sys.argv)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")
    monkeypatch.setattr("forcegrasp.cli.sweep._draw_curves", lambda folder: None)
    swept = [f"gripper={DEFAULT_GRIPPER},franka_hand", "hydra.sweep.dir=sweep"]
    assert main(["train", "-m", *swept, *tiny["train"]]) == 0
    names = ["ib_franka_hand_s0_1", "ib_s0_0"]
    assert sorted(path.parent.name for path in Path("sweep").glob("*/config.yaml")) == names


def test_hint_and_card_name_the_model(tmp_path):
    run, config = RunDir(tmp_path / "my run"), TrainConfig(model="better.yaml")
    words = shlex.split(evaluate_command(run, config))
    assert words == ["forcegrasp", "evaluate", f"policies=[{run.path},force_pi]", f"model={run.path}/model.yaml"]
    assert "model=" not in evaluate_command(run, TrainConfig())
    text = card(run, config)
    assert "model better.yaml" in text.splitlines()[0]
    assert evaluate_command(run, config) in text
    assert "model" not in card(run, TrainConfig()).splitlines()[0]
    assert "the nominal gripper" in card(run, TrainConfig())
    assert "another robot in every grasp" in card(run, TrainConfig(randomise="catalogue"))
    assert "plan=robots" in evaluate_command(run, TrainConfig(randomise="catalogue"))


def test_a_run_is_judged_as_the_hint_says_or_told(tiny, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda *args, **kwargs: None)  # most of the time
    monkeypatch.setattr("forcegrasp.reports.html._svg", lambda figure: "")
    assert main(["train", *tiny["train"], f"model={MODEL}"]) == 0
    (run,) = Path("runs").iterdir()
    assert re.search(r"_ib_config_s0$", run.name)  # tests/config/model.yaml
    hint = shlex.split(capsys.readouterr().out.rpartition("hand-written one: ")[2])
    assert hint[:2] == ["forcegrasp", "evaluate"]
    assert main([*hint[1:], *tiny["evaluate"], "out=a"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert f"Simulated: model {run}/model.yaml" in said
    assert "was trained with" not in said
    assert main(["evaluate", f"policies=[{run}]", *tiny["evaluate"], "out=b"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert f"was trained with the model {MODEL}, but is judged here on the nominal gripper" in said
    assert f"to judge it on its own: model={run}/model.yaml" in said
