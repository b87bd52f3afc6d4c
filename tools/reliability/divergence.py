"""Divergence that is put into the simulation: it is always reported, and never reset in silence as MuJoCo does."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from forcegrasp.config import GraspConfig
from forcegrasp.errors import PhysicsError
from forcegrasp.physics import GraspSampler, GraspSimulator
from tools.reliability.trial import Promise, Trial

ROWS = 8
#: Fields of MuJoCo's data that are spoilt. The command is spoilt by NaN alone: it is clipped to what the joints reach.
FIELDS = ("qpos", "qvel", "qfrc_applied", "xfrc_applied", "command")


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Each spoils one number of one grasp at a random step; the error must name that grasp and that step."""
    rng = np.random.default_rng(seed)
    simulators = {tier: GraspSimulator(ROWS, tier, threads=1) for tier in ("fast", "reference")}
    sampler = GraspSampler(GraspConfig())
    for number in range(count):
        tier = ("fast", "reference")[number % 2]
        simulator = simulators[tier]
        simulator.reset(sampler(rng, np.arange(ROWS)))
        for _ in range(int(rng.integers(0, 6))):
            simulator.step(rng.uniform(-0.003, 0.003, (ROWS, 2)))
        row, field, value = int(rng.integers(ROWS)), str(rng.choice(FIELDS)), _value(rng)
        delta = np.zeros((ROWS, 2))
        if field == "command":
            value = np.nan
            delta[row, rng.integers(2)] = value
        else:
            numbers = simulator.plant.batch.bind(field)[row].reshape(-1)
            at = int(rng.integers(len(numbers)))
            if field == "xfrc_applied":  # the world's body does not move
                at = 6 * simulator.model.body("object").id + at % 6
            numbers[at] = value
        expected = f"grasp {row} diverged at control step {simulator.steps[row]} "
        try:
            simulator.step(delta)
            problem = "nothing was reported"
        except PhysicsError as error:
            problem = "" if expected in str(error) else f"reported another: {error}"
        yield Trial(f"{number} {tier}: {field} = {value:.3g} in grasp {row}", problem, field)


def _value(rng: np.random.Generator) -> float:
    sign = rng.choice([-1.0, 1.0])
    return float(rng.choice([np.nan, np.inf * sign, sign * 10 ** rng.uniform(15, 300)]))


PROMISE = Promise(
    "a simulation that diverges is reported with the grasp, the step and the parameters", 1000, 40, trials
)
