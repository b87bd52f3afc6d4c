"""Policies are trained, judged and shown with the noise of the model that is simulated, unless options say other."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from forcegrasp.cli.main import main
from forcegrasp.config import (
    EvaluateConfig,
    GraspConfig,
    PhysicsConfig,
    PPOConfig,
    RenderConfig,
    SensorConfig,
    TrainConfig,
)
from forcegrasp.env import build_env
from forcegrasp.evaluate import compare_policies, render
from forcegrasp.models.model_file import Model, read_model, write_model
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.collector import training_env
from forcegrasp.train.loop import Trainer
from forcegrasp.transforms import ObservationNoise

NOISE = (1.5e-4, 0.07)


def model_with_noise() -> Model:
    return dataclasses.replace(read_model("virtual_robot"), noise=NOISE)


def noise_of(env) -> list[float]:
    return next(t for t in env.transform.modules() if isinstance(t, ObservationNoise)).std


@pytest.mark.parametrize(
    ("model", "sensors", "std"),
    [
        (model_with_noise(), None, list(NOISE)),
        (model_with_noise(), SensorConfig(force_std_n=0.5), [NOISE[0], 0.5]),
        (read_model("virtual_robot"), None, [2.7e-5, 0.013]),
        (None, None, [2.7e-5, 0.013]),
    ],
    ids=["the model's", "as given", "a model without", "the gripper's"],
)
def test_noise_of_readings(model, sensors, std):
    env = build_env(8, model=model, sensors=sensors)
    assert noise_of(env) == std
    env.close()


def test_readings_are_that_noisy():
    env = build_env(8, model=model_with_noise())
    assert_as_noisy(env.rollout(30))
    env.close()


def assert_as_noisy(seen) -> None:
    for name, std in zip(("position", "force"), NOISE, strict=True):
        assert float((seen[f"sensed_{name}"] - seen[f"measured_{name}"]).std()) == pytest.approx(std, rel=0.15)


@pytest.fixture
def model_file(tmp_path) -> Path:
    write_model(model_with_noise(), tmp_path / "noisy.yaml")
    return tmp_path / "noisy.yaml"


@pytest.mark.parametrize(("force_std_n", "std"), [(SensorConfig().force_std_n, NOISE), (0.5, (NOISE[0], 0.5))])
def test_a_training_has_it_in_all_workers_and_when_it_is_resumed(model_file, tmp_path, force_std_n, std):
    config = TrainConfig(
        model=str(model_file), ppo=PPOConfig(grasps=2, hidden=[4]), sensors=SensorConfig(force_std_n=force_std_n)
    )
    run = RunDir.create(tmp_path / "run", config, [])
    for given in (lambda: config, run.config):  # begun, resumed
        trainer = Trainer(given(), run.model(config))
        worker = training_env(trainer.config, run.model(config), worker=1)
        assert noise_of(trainer.env) == noise_of(worker) == list(std)
        assert (trainer.config.sensors.position_std_m, trainer.config.sensors.force_std_n) == std
        trainer.collector.shutdown()
        model_file.unlink(missing_ok=True)


def test_the_command_line_trains_with_it(model_file, tmp_path):
    tiny = ["ppo.grasps=1", "ppo.total_frames=1", "grasp.steps=2", "log.video_every=0", "log.figures_every=0"]
    assert main(["train", f"model={model_file}", f"hydra.run.dir={tmp_path / 'run'}", *tiny]) == 0
    sensors = RunDir.open(tmp_path / "run").config().sensors
    assert (sensors.position_std_m, sensors.force_std_n) == NOISE


def test_a_policy_is_judged_with_it(model_file, tmp_path, monkeypatch):
    judged = []
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda *args, **kwargs: None)
    monkeypatch.setattr("forcegrasp.reports.html._svg", lambda figure: "")
    summarise = compare_policies.summarise
    monkeypatch.setattr(compare_policies, "summarise", lambda *told: judged.append(told) or summarise(*told))
    config = {"kappas": 2, "trials": 3, "grasp": GraspConfig(steps=40), "physics": PhysicsConfig("fast", threads=1)}
    compare_policies.evaluate(EvaluateConfig(["close"], model=str(model_file), **config), tmp_path / "out")
    ((episodes, sensors, _),) = judged
    assert_as_noisy(episodes)
    assert (sensors.position_std_m, sensors.force_std_n) == NOISE


def test_a_policy_is_shown_with_it(model_file, tmp_path, monkeypatch):
    shown = []
    monkeypatch.setattr(render, "grasp_video", lambda episodes, sensors, **_: shown.append((episodes, sensors)) or b"")
    config = RenderConfig(["close"], model=str(model_file), physics=PhysicsConfig("fast", threads=1))
    render.render(config, tmp_path / "grasp.gif")
    ((episodes, sensors),) = shown
    assert_as_noisy(episodes["close"])
    assert (sensors.position_std_m, sensors.force_std_n) == NOISE
