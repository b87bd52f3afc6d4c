"""Grippers, objects and effects drawn from all that is allowed, grasped at random: MuJoCo never warns."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from forcegrasp.effects.base import Effect
from forcegrasp.effects.registry import catalogue
from forcegrasp.physics import default_gripper
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.guard import silence_log
from forcegrasp.physics.plant import Plant, write_base
from tools.reliability.trial import Promise, Trial

STEPS = 150
#: Grasps that are simulated at once.
ROWS = 400
#: Largest change of a command in a step, and how the fingers are commanded: mean and spread, as shares of it.
DELTA_M = 0.003
STYLES = np.array([(0.0, 1.0), (-0.5, 0.7), (-1.0, 0.0), (0.0, 3.0)])
_KINDS = [(effect, variant) for effect in catalogue().values() for variant in effect.variants]


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Each is a grasp of 150 control steps, one in four in the reference tier, with up to two effects."""
    silence_log()
    gripper = load_gripper("tiago")
    for first in range(0, count, ROWS):
        rng = np.random.default_rng([seed, first])
        tier, rows = ("fast", "fast", "reference", "fast")[first // ROWS % 4], min(ROWS, count - first)
        plant = Plant(gripper, rows, tier, threads=1)
        said = _attach(plant, rng)
        drawn = draw(gripper, rows, rng)
        plant.reset(np.arange(rows), write_base(plant, np.arange(rows), drawn))
        warned = grasp(plant, rng)
        for row in range(rows):
            values = ", ".join(f"{name}={value[row]:.4g}" for name, value in drawn.items())
            problem = f"{values}: warned of {', '.join(warned[row])}" if warned[row] else ""
            yield Trial(f"{first + row} {tier} {said[row]}", problem, f"{tier}, {said[row].count('(')} effects")


def draw(gripper: Gripper, rows: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Base parameters within their bounds, each ``(rows,)``; objects stand between the open fingers."""
    drawn = {name: rng.uniform(p.low, p.high, rows) for name, p in gripper.parameters.items()}
    room = np.maximum(gripper.stroke - drawn["radius_m"], 0)
    drawn["offset_m"] = np.clip(drawn["offset_m"], -room, room)
    return drawn


def _attach(plant: Plant, rng: np.random.Generator) -> list[str]:
    """Puts up to two effects on each row, with parameters within their bounds; says which."""
    chosen = rng.integers(len(_KINDS), size=(plant.n, 2))
    used = np.arange(2) < rng.integers(3, size=plant.n)[:, None]
    said, effects = [""] * plant.n, list[tuple[Effect, np.ndarray]]()
    for index, (kind, variant) in enumerate(_KINDS):
        rows = np.flatnonzero(((chosen == index) & used).any(axis=1))
        if not len(rows) or not kind.parameters:
            continue
        low, high = (np.array([getattr(p, end) for p in kind.parameters]) for end in ("low", "high"))
        values = rng.uniform(low, high, (len(rows), len(low)))
        effects.append((kind(values, plant.dt, variant, high), rows))
        for row, value in zip(rows, values, strict=True):
            said[row] += f" {kind.name} {variant}({', '.join(f'{v:.4g}' for v in value)})"
    plant.attach(effects)
    return said


def grasp(plant: Plant, rng: np.random.Generator) -> list[list[str]]:
    """Commands all rows at random for an episode; returns the names of MuJoCo's warnings, row by row."""
    style = STYLES[rng.integers(len(STYLES), size=plant.n)]
    for _ in range(STEPS):
        share = np.clip(style[:, :1] + style[:, 1:] * rng.uniform(-1, 1, (plant.n, 2)), -1, 1)
        command = np.clip(plant.measured_position + DELTA_M * share, 0, plant.gripper.stroke)
        plant.advance(command, round(default_gripper().period_s / plant.dt))
    warnings = plant.warnings()
    return [[mujoco.mjtWarning(int(kind)).name for kind in np.flatnonzero(counts)] for counts in warnings]


PROMISE = Promise("150 steps of any allowed gripper, object and effects raise no warning of MuJoCo", 10_000, 4, trials)
