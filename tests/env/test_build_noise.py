"""An environment reads with the noise of the model it simulates, unless its options say otherwise."""

from __future__ import annotations

import dataclasses

import pytest

from forcegrasp.config import SensorConfig
from forcegrasp.env import build_env
from forcegrasp.models.model_file import Model, read_model
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
    seen = env.rollout(30)
    for name, std in zip(("position", "force"), NOISE, strict=True):
        assert float((seen[f"sensed_{name}"] - seen[f"measured_{name}"]).std()) == pytest.approx(std, rel=0.15)
    env.close()
