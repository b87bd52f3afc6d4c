"""Draws grippers from a fitted model: every episode another one within the fitted intervals."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from forcegrasp.effects.base import Effect
from forcegrasp.errors import ConfigError
from forcegrasp.models.model_file import Fitted, Model, read_model
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.plant import Plant


def read_model_of(gripper: Gripper, source: Model | str | Path) -> Model:
    """Returns a model of this gripper, from its file unless it is one.

    Raises:
      ConfigError: if it can't be read, or is of another gripper.
    """
    model = source if isinstance(source, Model) else read_model(Path(source))
    if model.gripper.name != gripper.name:
        name = "model" if isinstance(source, Model) else f"model={source}"
        raise ConfigError(
            f"{name}: is of gripper {model.gripper.name}, and gripper={gripper.name} is asked for;"
            f" say gripper={model.gripper.name_or_path}, too"
        )
    return model


def with_noise_of(gripper: Gripper, model: Model | None) -> Gripper:
    """The gripper, with readings as noisy as a model of it says, if there is one that says it."""
    if model is None or model.noise is None:
        return gripper
    position_std, force_std = model.noise
    training = dataclasses.replace(gripper.training, position_std=position_std, force_std_n=force_std)
    return dataclasses.replace(gripper, training=training)


class ModelVariation:
    """A fitted model whose numbers are drawn uniformly from their 95 % intervals at each reset.

    Args:
      model: base parameters of the gripper, and the effects that were found.
    """

    def __init__(self, model: Model) -> None:
        self.model = model

    def attach(self, plant: Plant) -> None:
        """Puts the model's effects into a plant, on all of its rows."""
        rows = np.arange(plant.n)
        self._effects: list[Effect] = []
        for found in self.model.effects:
            largest = np.array([found.parameters[p.name].high for p in found.effect.parameters])
            self._effects.append(
                found.effect(np.repeat(found.values[None], plant.n, axis=0), plant.dt, found.variant, largest)
            )
        plant.attach([(effect, rows) for effect in self._effects])

    def draw(self, rng: np.random.Generator, ids: np.ndarray) -> dict[str, np.ndarray]:
        """Draws effects for these rows, and returns base parameters for them, each ``(len(ids),)``."""
        base = {name: _within(fitted, rng, len(ids)) for name, fitted in self.model.base.items()}
        for effect, found in zip(self._effects, self.model.effects, strict=True):
            for column, parameter in enumerate(effect.parameters):
                effect.values[ids, column] = _within(found.parameters[parameter.name], rng, len(ids))
        return base


def _within(fitted: Fitted, rng: np.random.Generator, count: int) -> np.ndarray:
    if fitted.low == fitted.high:  # also where both are infinite
        return np.full(count, fitted.value)
    return rng.uniform(fitted.low, fitted.high, count)
