"""What the fast tier costs and how far it is from the reference tier, part by part.

    python tools/fast_tier.py [--gripper NAME] [--grasps 64] [--repeats 3]

Every variant does the same grasps, drawn from the gripper's ranges: it closes at full speed, squeezes, lets go,
squeezes again. Deviations are from the reference tier. Costs are of one thread; variants take turns, and the best
of their repeats counts.
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

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.config import GraspConfig
from forcegrasp.physics import GraspSampler
from forcegrasp.physics.fast import SPHERE
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant, write_base
from forcegrasp.physics.simulator import base_parameters

STEPS = 150


@dataclass(frozen=True)
class Variant(Gripper):
    """A gripper whose fast model is changed after it was compiled."""

    change: Callable[[Gripper, mujoco.MjModel], None] = lambda gripper, model: None

    def compile(self, tier: str = "reference") -> mujoco.MjModel:
        model = super().compile(tier)
        self.change(self, model)
        return model


Change = Callable[[Gripper, mujoco.MjModel], None]


def step(milliseconds: float, make_up: bool = True) -> Change:
    """Another physics step, with or without making up for it in the damping."""

    def change(gripper: Gripper, model: mujoco.MjModel) -> None:
        scene = gripper.spec().compile()
        model.opt.timestep = milliseconds / 1000
        for motor in gripper.motors:
            dof, gain = model.joint(motor.joint).dofadr[0], model.actuator(motor.actuator).gainprm[0]
            larger = model.opt.timestep - scene.opt.timestep
            model.dof_damping[dof] = scene.dof_damping[dof] + make_up * gain * larger / 2

    return change


def in_the_middle(change: Change) -> Change:
    """Besides, the sphere in the middle of the object instead of between the pads."""

    def both(gripper: Gripper, model: mujoco.MjModel) -> None:
        change(gripper, model)
        model.geom(SPHERE.format(gripper.object_geom)).pos[:] = 0

    return both


VARIANTS: dict[str, tuple[str, Change]] = {
    "reference": ("reference", lambda gripper, model: None),
    "sphere in the middle, 2 ms": ("fast", in_the_middle(step(2))),
    "sphere in the middle, 4 ms, uncorrected": ("fast", in_the_middle(step(4, make_up=False))),
    "sphere between the pads, 2 ms": ("fast", step(2)),
    "8 ms, uncorrected": ("fast", step(8, make_up=False)),
    "4 ms": ("fast", step(4)),
    "8 ms": ("fast", step(8)),
    "the fast tier": ("fast", lambda gripper, model: None),
    "10 ms": ("fast", step(10)),
}


class Run:
    """One variant and the grasps that it simulates."""

    def __init__(self, gripper: Gripper, tier: str, change: Change, n: int) -> None:
        self.gripper = gripper
        changed = Variant(**{field.name: getattr(gripper, field.name) for field in fields(gripper)}, change=change)
        self.plant = Plant(changed, n, tier, threads=1)
        self.ids = np.arange(n)
        self.grasps = GraspSampler(GraspConfig(), gripper)(np.random.default_rng(0), self.ids)
        rng, shape = np.random.default_rng(1), (n, len(gripper.motors))
        self.deltas = np.full((STEPS, *shape), -gripper.max_step)
        self.deltas[45:90] *= rng.uniform(0, 1, shape)
        self.deltas[90:120] *= rng.uniform(-1, 0.3, shape)
        self.deltas[120:] *= rng.uniform(0, 1, shape)

    def __call__(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions of the motors, m or rad, and forces, newtons, after each command: ``(STEPS, n, motors or 2)``."""
        plant, gripper = self.plant, self.gripper
        plant.reset(self.ids, write_base(plant, self.ids, base_parameters(gripper, self.grasps)))
        position, force = np.empty(self.deltas.shape), np.empty((STEPS, plant.n, 2))
        for index, delta in enumerate(self.deltas):
            plant.advance(np.clip(plant.position + delta, 0, gripper.stroke), round(gripper.period_s / plant.dt))
            position[index], force[index] = plant.position, plant.force
        return position, force


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--gripper", default=DEFAULT_GRIPPER, help=f"name or path of its description ({DEFAULT_GRIPPER})"
    )
    parser.add_argument("--grasps", type=int, default=64)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    gripper = load_gripper(options.gripper)
    runs = {name: Run(gripper, tier, change, options.grasps) for name, (tier, change) in VARIANTS.items()}
    best, ends = dict.fromkeys(runs, float("inf")), {}
    for _ in range(options.repeats):
        for name, run in runs.items():
            started = time.process_time()
            ends[name] = run()
            best[name] = min(best[name], time.process_time() - started)
    table = Table(title=f"{options.grasps} grasps of {STEPS} commands, one thread")
    for heading in (
        "variant",
        "times as fast",
        "mean |Δf|, mN",
        "held force, worst grasp, mN",
        f"mean |Δq|, µ{gripper.unit}",
    ):
        table.add_column(heading, justify="left" if heading == "variant" else "right")
    right_position, right_force = ends["reference"]
    for name, (position, force) in ends.items():
        held = np.abs((force - right_force)[-20:].mean(axis=0)).max()
        off = np.abs(force - right_force).mean(), held, np.abs(position - right_position).mean() * 1000
        table.add_row(name, f"{best['reference'] / best[name]:.1f}", *(f"{value * 1000:.1f}" for value in off))
    Console().print(table)


if __name__ == "__main__":
    main()
