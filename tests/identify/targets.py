"""Targets and fits that are made up, for tests of what is reckoned from residuals and slopes."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects import get_effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.phases import PHASES
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.target import Target
from forcegrasp.measure import MeasuredGrasp
from forcegrasp.physics.gripper_file import load_gripper

G, S = 8, 150
TIAGO = load_gripper("tiago")
ONES = np.ones(4)


def grasp(index: int, split: str | None = None, thing: str | None = None) -> MeasuredGrasp:
    pair = np.zeros((S, 2))
    thing = thing or ("cup", "ball")[index % 2]
    return MeasuredGrasp(f"g{index}", thing, "", 0.02, 0.0, split, np.arange(S) * 0.04, pair, pair, pair, None)


def make(count: int = G, lengths: tuple[int, ...] | None = None) -> Target:
    """A target whose grasps pass through all phases; noise 1 in every signal."""
    mask = np.arange(S) < np.array(lengths or [S] * count)[:, None]
    phase = np.where(mask, np.arange(S) * len(PHASES) // S, -1)
    grasps = tuple(grasp(i) for i in range(count))
    return Target(
        grasps, np.zeros((count, S, 4)), mask, ONES, ONES, 0 * ONES, True, phase, TIAGO, np.ones((count, 1, 1))
    )


def noise(seed: int = 0) -> np.ndarray:
    """White, of 1 in every reading."""
    return np.random.default_rng(seed).standard_normal((G, S, 4))


def fit_at(jacobian: np.ndarray, residual: np.ndarray, *effects: str, **values: float) -> Fit:
    """A fit of one object's grasps that ended at these values, nominal or typical by default."""
    grasps = [grasp(i, thing="cup") for i in range(len(residual))]
    problem = Problem(TIAGO, grasps, [EffectSetting.typical(get_effect(name)) for name in effects])
    vector = np.array([e.coordinate(values.get(e.parameter, e.start)) for e in problem.entries])
    return Fit(problem, vector, 0 * residual, residual, jacobian, 0 * residual, 0.0, 1, np.ones((len(residual), 1, 1)))


def random_slopes(p: int, size: float = 50.0) -> np.ndarray:
    return size * np.random.default_rng(3).standard_normal((G, S, 4, p))
