"""What the fast tier costs and how far it is from the reference tier, part by part.

    python tools/fast_tier.py [--grasps 64] [--repeats 3]

Every variant does the same grasps, drawn from the paper's ranges: it closes at full speed, squeezes, lets go, squeezes
again. Deviations are from the reference tier. Costs are of one thread; variants take turns, and the best of their
repeats counts.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, fields

import mujoco
import numpy as np
from rich.console import Console
from rich.table import Table

from forcegrasp.config import GraspConfig
from forcegrasp.physics import GraspSampler
from forcegrasp.physics.fast import SPHERE
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant, write_base

TIAGO = load_gripper("tiago")
MAX_DELTA_M, STEPS = 0.003, 150


@dataclass(frozen=True)
class Variant(Gripper):
    """A gripper whose fast model is changed after it was compiled."""

    change: Callable[[mujoco.MjModel], None] = lambda model: None

    def compile(self, tier: str = "reference") -> mujoco.MjModel:
        model = super().compile(tier)
        self.change(model)
        return model


def step(milliseconds: float, make_up: bool = True) -> Callable[[mujoco.MjModel], None]:
    """Another physics step, with or without making up for it in the damping."""

    def change(model: mujoco.MjModel) -> None:
        model.opt.timestep = milliseconds / 1000
        for motor in TIAGO.motors:
            dof, gain = model.joint(motor.joint).dofadr[0], model.actuator(motor.actuator).gainprm[0]
            model.dof_damping[dof] = 1 + make_up * gain * (model.opt.timestep - 0.002) / 2

    return change


def in_the_middle(change: Callable[[mujoco.MjModel], None]) -> Callable[[mujoco.MjModel], None]:
    """Besides, the sphere in the middle of the object instead of between the pads."""

    def both(model: mujoco.MjModel) -> None:
        change(model)
        model.geom(SPHERE.format(TIAGO.object_geom)).pos[:] = 0

    return both


VARIANTS: dict[str, tuple[str, Callable[[mujoco.MjModel], None]]] = {
    "reference": ("reference", lambda model: None),
    "sphere in the middle, 2 ms": ("fast", in_the_middle(step(2))),
    "sphere in the middle, 4 ms, uncorrected": ("fast", in_the_middle(step(4, make_up=False))),
    "sphere between the pads, 2 ms": ("fast", step(2)),
    "8 ms, uncorrected": ("fast", step(8, make_up=False)),
    "4 ms": ("fast", step(4)),
    "8 ms: the fast tier": ("fast", lambda model: None),
    "10 ms": ("fast", step(10)),
}


class Run:
    """One variant and the grasps that it simulates."""

    def __init__(self, tier: str, change: Callable[[mujoco.MjModel], None], n: int) -> None:
        gripper = Variant(**{field.name: getattr(TIAGO, field.name) for field in fields(TIAGO)}, change=change)
        self.plant = Plant(gripper, n, tier, threads=1)
        self.ids = np.arange(n)
        self.grasps = GraspSampler(GraspConfig())(np.random.default_rng(0), self.ids)
        rng = np.random.default_rng(1)
        self.deltas = np.full((STEPS, n, 2), -MAX_DELTA_M)
        self.deltas[45:90] *= rng.uniform(0, 1, (n, 2))
        self.deltas[90:120] *= rng.uniform(-1, 0.3, (n, 2))
        self.deltas[120:] *= rng.uniform(0, 1, (n, 2))

    def __call__(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and forces after each command, metres and newtons, ``(STEPS, n, 2)``."""
        plant, grasps = self.plant, self.grasps
        base = {
            "velocity_gain": grasps.b2,
            "rho_m": np.asarray(TIAGO.training.at("rho_m", grasps.kappa)),
            "force_scale": np.asarray(TIAGO.training.force_scale(grasps.kappa)),
            "radius_m": grasps.radius_m,
            "offset_m": grasps.offset_m,
        }
        plant.reset(self.ids, write_base(plant, self.ids, base))
        position, force = np.empty((2, STEPS, plant.n, 2))
        for index, delta in enumerate(self.deltas):
            plant.advance(np.clip(plant.position + delta, 0, TIAGO.stroke), round(TIAGO.period_s / plant.dt))
            position[index], force[index] = plant.position, plant.force
        return position, force


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--grasps", type=int, default=64)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    runs = {name: Run(tier, change, options.grasps) for name, (tier, change) in VARIANTS.items()}
    best, ends = dict.fromkeys(runs, float("inf")), {}
    for _ in range(options.repeats):
        for name, run in runs.items():
            started = time.process_time()
            ends[name] = run()
            best[name] = min(best[name], time.process_time() - started)
    table = Table(title=f"{options.grasps} grasps of {STEPS} commands, one thread")
    for heading in ("variant", "times as fast", "mean |Δf|, mN", "held force, worst grasp, mN", "mean |Δq|, µm"):
        table.add_column(heading, justify="left" if heading == "variant" else "right")
    right_position, right_force = ends["reference"]
    for name, (position, force) in ends.items():
        held = np.abs((force - right_force)[-20:].mean(axis=0)).max()
        off = np.abs(force - right_force).mean(), held, np.abs(position - right_position).mean() * 1000
        table.add_row(name, f"{best['reference'] / best[name]:.1f}", *(f"{value * 1000:.1f}" for value in off))
    Console().print(table)


if __name__ == "__main__":
    main()
