"""Which grasps policies are compared on: cells (softness values, or objects) of several trials each."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from forcegrasp.config import EvaluateConfig, GraspConfig
from forcegrasp.errors import ConfigError
from forcegrasp.files.validate import counted, must, refusal, validate
from forcegrasp.measure.yaml_file import Number, TextRecord, load_yaml
from forcegrasp.physics import GraspParameters, GraspSampler, Gripper, default_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.physics.sampling import offset_limits_m

FORMAT = "forcegrasp-objects/1"
#: Name of the objects that come with the package.
PAPER_OBJECTS = "paper"


@dataclass(frozen=True)
class Grid:
    """Grasps in cells of equal size."""

    what: str  #: what the cells differ in
    cells: list[str]
    grasps: GraspParameters  #: those of one cell next to each other

    @property
    def trials(self) -> int:
        """Grasps in a cell."""
        return len(self.grasps) // len(self.cells)


@dataclass(frozen=True)
class GraspedObject:
    """An object to grasp, and how firmly."""

    name: str
    diameter_m: float
    kappa: float
    goal_force_n: tuple[float, float]


def make_grid(config: EvaluateConfig, gripper: Gripper) -> Grid:
    """The grasps that an evaluation asks for: of its objects if it names some, else by softness."""
    if config.objects:
        objects = read_objects(config.objects, config.grasp, gripper)
        return object_grid(objects, config.grasp, config.trials, config.seed, gripper)
    return kappa_grid(config.grasp, config.kappas, config.trials, config.seed, gripper)


def kappa_grid(grasp: GraspConfig, kappas: int, trials: int, seed: int, gripper: Gripper | None = None) -> Grid:
    """Draws ``trials`` grasps for each of ``kappas`` evenly spaced softness values; all else random."""
    rng, parts = np.random.default_rng(seed), []
    values = np.linspace(*grasp.kappa, num=kappas)
    for kappa in values:
        sampler = GraspSampler(dataclasses.replace(grasp, kappa=[float(kappa)] * 2), gripper)
        parts.append(sampler(rng, np.arange(trials)))
    return Grid("softness κ (0 hard, 1 soft)", [f"{k:.3g}" for k in values], GraspParameters.concatenate(parts))


def object_grid(
    objects: list[GraspedObject], grasp: GraspConfig, trials: int, seed: int, gripper: Gripper | None = None
) -> Grid:
    """Draws ``trials`` grasps of each object, as in the paper's Table 1: the object stands nearer to one finger.

    Goal force and actuator are drawn; the offset is between half of what paper eqs. 1-2 allow and all of it, to
    either side.
    """
    gripper = gripper or default_gripper()
    grasp = complete(grasp, gripper)
    rng, parts = np.random.default_rng(seed), []
    for item in objects:
        radius = np.full(trials, item.diameter_m / 2)
        share, side = rng.uniform(0.5, 1, trials), rng.choice([-1, 1], trials)
        lowest, highest = offset_limits_m(gripper, radius, grasp.deformation_m)
        offset = np.where(side < 0, lowest, highest) * share
        b2, goal = rng.uniform(*grasp.b2, size=trials), rng.uniform(*item.goal_force_n, trials)
        parts.append(GraspParameters(np.full(trials, item.kappa), b2, radius, offset, goal))
    return Grid("object", [item.name for item in objects], GraspParameters.concatenate(parts))


def read_objects(name: str, grasp: GraspConfig, gripper: Gripper | None = None) -> list[GraspedObject]:
    """Reads a file of objects; ``paper`` names the six of the paper's Table 1.

    Raises:
      ConfigError, MeasurementError: names the file, the object and the key, and what it must be.
    """
    gripper = gripper or default_gripper()
    grasp = complete(grasp, gripper)
    path = Path(str(files("forcegrasp.assets") / "paper_objects.yaml")) if name == PAPER_OBJECTS else Path(name)
    said = validate(_File, load_yaml(path), path)
    if said.format != FORMAT:
        raise ConfigError(f"{path}: format: must be {FORMAT}")
    widest = float(gripper.opening.opening_m[-1])
    for name, item in said.objects.items():
        low, high = item.goal_force_n
        for key, value, least, most in (
            ("diameter_m", item.diameter_m, 2 * grasp.deformation_m, widest),
            ("kappa", item.kappa, -1e-12, 1 + 1e-12),
            ("goal_force_n", low, 0, 50),
            ("goal_force_n", high, 0, 50),
        ):
            if not least < value < most:
                raise refusal(path, f"objects.{name}.{key}", f"must lie between {least:.3g} and {most:.3g}")
    return [GraspedObject(name, i.diameter_m, i.kappa, i.goal_force_n) for name, i in said.objects.items()]


_ORDERED = must(lambda ends: ends[0] <= ends[1], "{0[0]:g} > {0[1]:g}; must be [low, high]")
_EXAMPLE = "cup: {diameter_m: 0.06, kappa: 0.3, goal_force_n: [0.2, 0.9]}"


class _Object(TextRecord):
    diameter_m: Number
    kappa: Number
    goal_force_n: Annotated[tuple[Number, Number], counted(2, 2, "[low, high]"), _ORDERED]


class _File(TextRecord):
    format: str
    objects: dict[str, _Object] = Field(min_length=1, examples=[_EXAMPLE])
