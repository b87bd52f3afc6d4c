"""Robots of one gripper, each with effects, gains, noise and objects of its own, drawn from the prior."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from forcegrasp.effects.base import Effect, Parameter
from forcegrasp.effects.for_gripper import effects_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.models.model_file import Fitted, FoundEffect, Model
from forcegrasp.models.object_body import ObjectBody
from forcegrasp.models.robot_prior import EFFECTS, FRICTION, GAINS, MASS, NOISE, SHAPE, Prior
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.plant import Plant
from forcegrasp.physics.sensors import rounding_steps
from forcegrasp.short_repr import ShortRepr

#: Seed of the robots that policies are compared on, together with a robot's number.
POPULATION = 20231


@dataclass(frozen=True, repr=False)
class Robots(ShortRepr):
    """``n`` robots of one gripper."""

    gripper: Gripper
    effects: tuple[EffectSetting, ...]  #: all that any may have; values ``(n, parameters)``, null for who has it not
    base: dict[str, np.ndarray]  #: base parameters of the gripper, ``(n,)`` each
    noise: np.ndarray  #: factors of the noise of positions and forces, ``(n, 2)``

    def __len__(self) -> int:
        return len(self.noise)

    def __getitem__(self, rows: np.ndarray) -> Robots:
        effects = tuple(EffectSetting(e.effect, e.variant, e.values[rows]) for e in self.effects)
        return Robots(self.gripper, effects, {name: v[rows] for name, v in self.base.items()}, self.noise[rows])

    @property
    def readings(self) -> np.ndarray:
        """Factors of the noise of positions and forces, then the steps that they are rounded to, ``(n, 4)``."""
        steps = rounding_steps((e.effect, e.values) for e in self.effects)
        return np.concatenate([self.noise, np.broadcast_to(steps, self.noise.shape)], axis=1)

    def has(self, effect: str) -> np.ndarray:
        """Which robots have an effect, in whichever variant, ``(n,)``."""
        found = [_present(e) for e in self.effects if e.effect.name == effect]
        return np.any(found, axis=0) if found else np.zeros(len(self), bool)

    def sizes(self, robot: int) -> Iterator[tuple[str, float]]:
        """Everything that makes a robot what it is: name and value."""
        yield from ((name, float(values[robot])) for name, values in self.base.items())
        yield from zip(("position_noise_factor", "force_noise_factor"), map(float, self.noise[robot]), strict=True)
        for setting in self.effects:
            if _present(setting)[robot]:
                where = f"{setting.effect.name} {setting.variant}".strip()
                for p, value in zip(setting.effect.parameters, setting.values[robot], strict=True):
                    yield f"{where}.{p.name}", float(value)


def draw_robots(gripper: Gripper, rng: np.random.Generator, count: int) -> Robots:
    """Draws robots from the prior, independent of one another in everything."""
    base = {}
    for name, p in gripper.parameters.items():
        if p.scope == "gripper":
            ranged = name == gripper.training.servo_gain
            values = rng.uniform(*gripper.training.servo_gain_range, count) if ranged else 0
            base[name] = values if ranged else np.clip(p.nominal * _factors(rng, GAINS, count), p.low, p.high)
    effects = []
    for effect, prior in _possible(gripper):
        variants = prior.variants_of(effect)
        chosen = rng.uniform(size=count) / prior.chance * len(variants)
        sizes = np.stack([_sizes(rng, effect, p, prior, count) for p in effect.parameters], axis=1)
        for number, variant in enumerate(variants):
            present = (number <= chosen) & (chosen < number + 1)
            effects.append(EffectSetting(effect, variant, np.where(present[:, None], sizes, effect.null_values())))
    return Robots(gripper, tuple(effects), base, _factors(rng, NOISE, (count, 2)))


def size_ranges(gripper: Gripper) -> dict[str, list[tuple[Parameter, float, float]]]:
    """Effect → each of its parameters that is drawn, with the smallest and the largest absolute value."""
    return {
        e.name: [(p, *_range(e, p, prior)) for p in e.parameters if p.name not in prior.fixed]
        for e, prior in _possible(gripper)
    }


def population(gripper: Gripper, count: int) -> Robots:
    """The robots that policies are compared on: number k is the same one whatever the count.

    Those of even numbers are for development; on those of odd numbers nobody tunes anything.
    """
    drawn = [_robot(gripper, k) for k in range(count)]
    effects = [
        EffectSetting(one.effect, one.variant, np.concatenate([robot.effects[i].values for robot in drawn]))
        for i, one in enumerate(drawn[0].effects)
    ]
    base = {name: np.concatenate([robot.base[name] for robot in drawn]) for name in drawn[0].base}
    return Robots(gripper, tuple(effects), base, np.concatenate([robot.noise for robot in drawn]))


def robot_model(gripper: Gripper, number: int) -> Model:
    """A robot of the :func:`population` as a model whose numbers are certain, to be recorded or trained for alone."""
    robot = _robot(gripper, number)
    effects = tuple(
        FoundEffect(
            e.effect,
            e.variant,
            {p.name: _certain(v, p.unit) for p, v in zip(e.effect.parameters, e.values[0], strict=True)},
        )
        for e in robot.effects
        if _present(e)[0]
    )
    base = {name: _certain(values[0], gripper.parameters[name].unit) for name, values in robot.base.items()}
    position, force = robot.noise[0] * (gripper.training.position_std, gripper.training.force_std_n)
    return Model(gripper, base, effects=effects, noise=(float(position), float(force)))


def _robot(gripper: Gripper, number: int) -> Robots:
    return draw_robots(gripper, np.random.default_rng([POPULATION, number]), 1)


def _certain(value: float, unit: str) -> Fitted:
    return Fitted(float(value), float(value), float(value), unit)


class DrawnRobots:
    """Another robot from the prior for every grasp.

    Effects are attached to the rows whose robots have them, anew with each draw; other rows keep their effects' memory.

    Args:
      gripper: whose robots they are.
    """

    def __init__(self, gripper: Gripper) -> None:
        self.gripper = gripper

    def attach(self, plant: Plant) -> None:
        """Prepares a plant, once."""
        self._plant, self._attached = plant, {}
        self.readings = np.zeros((plant.n, 4))  #: see :attr:`Robots.readings`, ``(rows, 4)``
        kinds = [(e, variant, prior) for e, prior in _possible(self.gripper) for variant in prior.variants_of(e)]
        self._settings = [EffectSetting(e, v, np.repeat(e.null_values()[None], plant.n, axis=0)) for e, v, _ in kinds]
        self._largest = [np.array([_range(e, p, prior)[1] for p in e.parameters]) for e, _, prior in kinds]

    def draw(self, rng: np.random.Generator, ids: np.ndarray) -> dict[str, np.ndarray]:
        """Draws robots for these rows, and returns their base parameters, each ``(len(ids),)``."""
        robots = draw_robots(self.gripper, rng, len(ids))
        for own, drawn in zip(self._settings, robots.effects, strict=True):
            own.values[ids] = drawn.values
        self.readings[ids] = robots.readings
        self._attach(ids)
        return robots.base

    def _attach(self, ids: np.ndarray) -> None:
        """Attaches the effects that there are now; rows other than these keep their memory."""
        plant, before, self._attached = self._plant, self._attached, {}
        for number, (setting, largest) in enumerate(zip(self._settings, self._largest, strict=True)):
            rows = np.flatnonzero(_present(setting))
            if len(rows):
                effect = setting.effect(setting.values[rows], plant.dt, setting.variant, largest)
                self._attached[number] = effect, rows
        plant.attach(list(self._attached.values()))
        for number, (effect, rows) in self._attached.items():
            if (kept := ~np.isin(rows, ids)).any():
                old, old_rows = before[number]
                for name, values in old.state.items():
                    effect.state[name][kept] = values[np.isin(old_rows, rows[kept])]


class FixedRobots:
    """Given robots, one for each row.

    Args:
      robots: as many as the plant has rows.
    """

    def __init__(self, robots: Robots) -> None:
        self.robots, self.readings = robots, robots.readings

    def attach(self, plant: Plant) -> None:
        """Puts effects into a plant, each on the rows whose robots have it."""
        found = [(setting, np.flatnonzero(_present(setting))) for setting in self.robots.effects]
        plant.attach([(e.effect(e.values[rows], plant.dt, e.variant), rows) for e, rows in found if len(rows)])

    def draw(self, rng: np.random.Generator, ids: np.ndarray) -> dict[str, np.ndarray]:
        """Base parameters of these rows' robots, each ``(len(ids),)``."""
        return {name: values[ids] for name, values in self.robots.base.items()}


def _possible(gripper: Gripper) -> list[tuple[type[Effect], Prior]]:
    """Effects that a robot with this gripper may have."""
    there = [effect for name, effect in effects_of(gripper).items() if name in EFFECTS]
    return [(effect, EFFECTS[effect.name]) for effect in [*there, ObjectBody]]


def _present(setting: EffectSetting) -> np.ndarray:
    return (setting.values != setting.effect.null_values()).any(axis=1)


def _range(effect: type[Effect], parameter: Parameter, prior: Prior) -> tuple[float, float]:
    """Smallest and largest absolute value that is drawn."""
    if (value := prior.fixed.get(parameter.name)) is not None:
        return value, value
    own = {"mass_factor": MASS, "friction_factor": FRICTION}
    shapes = np.isfinite(parameter.null) and parameter.null != 0
    low, high = own.get(parameter.name, SHAPE if shapes else (prior.low, prior.high))[:2]
    alike = effect.parameters if effect.per else (parameter,)  # left and right
    typical = max(abs(p.typical) for p in alike)
    return max(low * typical, parameter.low), min(high * typical, parameter.high)


def _sizes(
    rng: np.random.Generator, effect: type[Effect], parameter: Parameter, prior: Prior, count: int
) -> np.ndarray:
    if (value := prior.fixed.get(parameter.name)) is not None:
        return np.full(count, value)
    size = _log_uniform(rng, *_range(effect, parameter, prior), count)
    return size * rng.choice([-1, 1], count) if parameter.low < 0 and prior.either_sign else size


def _factors(rng: np.random.Generator, ends: tuple[float, float, str], size: int | tuple[int, int]) -> np.ndarray:
    return _log_uniform(rng, *ends[:2], size)


def _log_uniform(rng: np.random.Generator, low: float, high: float, size: int | tuple[int, int]) -> np.ndarray:
    return np.exp(rng.uniform(np.log(low), np.log(high), size))
