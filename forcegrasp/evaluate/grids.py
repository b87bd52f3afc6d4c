"""Which grasps policies are compared on: cells (softness values, or objects) of several trials each."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np

from forcegrasp.config import GraspConfig
from forcegrasp.errors import ConfigError
from forcegrasp.measure.yaml_file import Reader, load_yaml
from forcegrasp.physics import GraspParameters, GraspSampler, Gripper, default_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.physics.sampling import offset_limits_m

FORMAT = "forcegrasp-objects/1"
#: Name of the objects that come with the package.
PAPER_OBJECTS = "paper"


@dataclass(frozen=True)
class Grid:
    """Grasps in cells of equal size."""

    what: str  #: what tells the cells apart
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
    top = Reader(load_yaml(path), str(path), ("format", "objects"))
    if top.text("format", 80) != FORMAT:
        raise ConfigError(f"{path}: format: must be {FORMAT}")
    listed = top.get("objects")
    if not isinstance(listed, dict) or not listed:
        raise ConfigError(f"{path}: objects: must hold an object a line, each `name: {{diameter_m: ...}}`")
    widest = float(gripper.opening.opening_m[-1])
    return [_read_object(path, key, entry, grasp, widest) for key, entry in listed.items()]


def _read_object(path: Path, name: str, entry: object, grasp: GraspConfig, widest_m: float) -> GraspedObject:
    place = f"{path}: objects.{name}"
    reader = Reader(entry, place, ("diameter_m", "kappa", "goal_force_n"))
    diameter = _between(reader, "diameter_m", 2 * grasp.deformation_m, widest_m)
    kappa = _between(reader, "kappa", -1e-12, 1 + 1e-12)
    goals = reader.get("goal_force_n")
    if not isinstance(goals, list) or len(goals) != 2:
        raise reader.refuse("goal_force_n", "must be [low, high]")
    bounds = Reader(dict(zip(("low", "high"), goals, strict=True)), f"{place}: goal_force_n", ("low", "high"))
    low, high = (_between(bounds, key, 0, 50) for key in ("low", "high"))
    if low > high:
        raise reader.refuse("goal_force_n", f"{low:g} > {high:g}; must be [low, high]")
    return GraspedObject(name, diameter, kappa, (low, high))


def _between(reader: Reader, key: str, low: float, high: float) -> float:
    value = reader.number(key)
    if value is None or not low < value < high:
        raise reader.refuse(key, f"must lie between {low:.3g} and {high:.3g}")
    return value
