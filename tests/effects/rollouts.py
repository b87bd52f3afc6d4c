"""A short rich grasp, simulated with any effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.effects import Effect
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant, write_base
from forcegrasp.physics.sensors import is_rounding

PERIOD_S = 0.04
START_M = 0.0275
FORCE_SCALE = 2.0
OFFSETS_M = np.array([0.0015, 0.0, -0.0008])


def path(*moves: tuple[float, float, float]) -> np.ndarray:
    """Commands of both fingers, ``(samples, 2)``. A move is (target in m, speed in m/s, pause in s)."""
    commands = [START_M] * 2
    for target, speed, pause in moves:
        steps = max(1, round(abs(target - commands[-1]) / (speed * PERIOD_S)))
        commands += list(np.linspace(commands[-1], target, steps + 1)[1:]) + [target] * round(pause / PERIOD_S)
    return np.repeat(np.array(commands)[:, None], 2, axis=1)


#: Free reversal, fast squeeze, hold, partial release, slow ramp, full release.
RICH = path(
    (0.0262, 0.02, 0.08),
    (0.0272, 0.02, 0.08),
    (0.0205, 1.0, 0.28),
    (0.0240, 0.03, 0.08),
    (0.0230, 0.005, 0.08),
    (0.0262, 0.03, 0.16),
)


@dataclass(frozen=True)
class Trace:
    """What was read and what happened after each command, ``(samples, n, 2)``, and of the object ``(samples, n)``."""

    position: np.ndarray
    force: np.ndarray
    true_position: np.ndarray
    true_force: np.ndarray
    thing: np.ndarray

    def row(self, i: int) -> list[bytes]:
        """Every bit of one row."""
        return [np.ascontiguousarray(values[:, i]).tobytes() for values in vars(self).values()]

    def rows(self, first: int, end: int) -> Trace:
        """Some of the rows, as a trace of their own."""
        return Trace(*(values[:, first:end] for values in vars(self).values()))

    def distance(self, other: Trace) -> float:
        """Root mean square difference of what was read, in units of sensor noise (27 µm, 13 mN)."""
        position, force = (self.position - other.position) / 27e-6, (self.force - other.force) / 0.013
        return float(np.sqrt((position**2).mean() + (force**2).mean()))


#: Effect, its parameter values ``(parameters,)`` or ``(rows, parameters)``, its variant, its rows.
Use = tuple[type[Effect], np.ndarray, str, Sequence[int]]


def make_plant(n: int, uses: Sequence[Use] = (), tier: str = "fast", gripper: str = "tiago") -> Plant:
    """A plant with effects, not reset yet."""
    plant = Plant(load_gripper(gripper), n, tier, threads=1)
    effects = []
    for kind, values, variant, rows in uses:
        values = np.broadcast_to(np.asarray(values, float), (len(rows), len(kind.parameters)))
        effects.append((kind(values, plant.dt, variant), np.asarray(rows)))
    plant.attach(effects)
    return plant


def start(plant: Plant, ids: Sequence[int], offset_m: np.ndarray | None = None) -> None:
    """Starts grasps with the fingers close to the object; offsets follow from the ids unless given."""
    ids = np.asarray(ids)
    write_base(plant, ids, {"force_scale": np.full(len(ids), FORCE_SCALE)})
    offset_m = OFFSETS_M[ids % 3] if offset_m is None else offset_m
    plant.reset(ids, offset_m, np.full((len(ids), 2), START_M))


def play(plant: Plant, commands: np.ndarray = RICH) -> Trace:
    """Sends commands to all rows alike, ``(samples, 2)``, or to each its own, ``(samples, n, 2)``."""
    if commands.ndim == 2:
        commands = np.repeat(commands[:, None], plant.n, axis=1)
    steps, seen = round(PERIOD_S / plant.dt), []
    for command in commands:
        plant.advance(command, steps)
        seen.append((*read(plant), plant.position, plant.force, plant.object_position))
    assert not plant.warnings().any()
    return Trace(*(np.array(values) for values in zip(*seen, strict=True)))


def read(plant: Plant) -> tuple[np.ndarray, np.ndarray]:
    """Positions and forces as sensors without noise give them: what the plant measures, then rounded."""
    position, force = plant.measured_position.copy(), plant.measured_force.copy()
    for effect in plant.effects:
        if is_rounding(type(effect)):
            position[effect.rows] = effect.read_position(position[effect.rows])
            force[effect.rows] = effect.read_force(force[effect.rows])
    return position, force


def rollout(
    n: int,
    uses: Sequence[Use] = (),
    tier: str = "fast",
    commands: np.ndarray = RICH,
    offset_m: np.ndarray | None = None,
) -> Trace:
    """Plays commands on a fresh plant."""
    plant = make_plant(n, uses, tier)
    start(plant, range(n), offset_m)
    return play(plant, commands)
