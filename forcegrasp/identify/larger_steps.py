"""Whether larger physics steps, which fits are quick by, still simulate the grasps of a set."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.identify.fit import Fit
from forcegrasp.identify.predict import predict
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target
from forcegrasp.physics.gripper import Gripper

# Grasps go another way if the two simulations differ in one by so many times the noise, root mean square. Where steps
# resolve the contacts it was 7 at most, and 26 to 2400 where they did not.
_ASTRAY = 10.0


def lead_astray(fit: Fit, target: Target) -> bool:
    """Whether grasps go another way with larger steps, where a fit ended.

    A scene says what its contacts are like at its nominal parameters; an object that is harder, or damped more firmly,
    may ask for shorter steps than these.
    """
    apart = np.where(target.mask[..., None], fit.correction / target.sigma, 0.0)
    readings = np.maximum(target.mask.sum(axis=1) * apart.shape[-1], 1)
    return bool(np.any(np.sum(apart**2, axis=(1, 2)) > _ASTRAY**2 * readings))


def with_own_steps(gripper: Gripper) -> Gripper:
    """The gripper, to be fitted with the steps of its scene alone."""
    return dataclasses.replace(gripper, own_steps=True)


def with_larger_steps_again(fit: Fit, target: Target) -> tuple[Target, Simulators, Fit] | None:
    """The same with larger physics steps, if grasps do not go another way with them where a fit with own steps ended.

    Contacts that make up for an effect that the model lacks may ask for short steps; with the effect they do not.
    """
    gripper = dataclasses.replace(target.gripper, own_steps=False)
    problem = Problem(gripper, fit.problem.grasps, fit.problem.effects)
    simulators = Simulators(problem)
    if simulators.one_model:
        return None
    correction = fit.predicted - predict(simulators.cheap, [problem.case(fit.vector)])[0]
    fit = dataclasses.replace(fit, problem=problem, correction=correction)
    return None if lead_astray(fit, target) else (dataclasses.replace(target, gripper=gripper), simulators, fit)
