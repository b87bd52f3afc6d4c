"""Grasps on a GPU: how fast, in control steps per second, and how far from MuJoCo on the CPU.

python tools/bench_gpu.py [--device cuda] [--grasps 1024 4096 16384] [--steps 150] [--tier fast] [--repeats 3]

Every level simulates whole episodes of grasps that close at full speed; training also updates the networks. The best of
the repeats counts. What is compiled and recorded at the start is reported separately.
"""

from __future__ import annotations

import argparse
import platform
import time
import warnings
from collections.abc import Callable

import numpy as np
import torch
from rich.console import Console
from rich.table import Table

warnings.filterwarnings("ignore", category=DeprecationWarning)
from forcegrasp.config import GraspConfig, PhysicsConfig, TrainConfig  # noqa: E402
from forcegrasp.controllers import Constant  # noqa: E402
from forcegrasp.env import build_env  # noqa: E402
from forcegrasp.errors import ForcegraspError  # noqa: E402
from forcegrasp.gpu.simulator import WarpGraspSimulator  # noqa: E402
from forcegrasp.physics import GraspSampler, GraspSimulator  # noqa: E402
from forcegrasp.train.loop import Trainer  # noqa: E402

#: Grasps whose forces are compared with MuJoCo's.
COMPARED = 64


def simulator(n: int, physics: PhysicsConfig, steps: int) -> Callable[[], object]:
    grasps = WarpGraspSimulator(n, physics.tier, physics.device)
    delta = torch.full((n, 2), -0.003, device=grasps.device)

    def run() -> None:
        grasps.reset(grasps.parameters)
        for _ in range(steps):
            grasps.step(delta)

    return run


def environment(n: int, physics: PhysicsConfig, steps: int) -> Callable[[], object]:
    env = build_env(n, physics=physics, grasp=GraspConfig(steps=steps))
    return lambda: env.rollout(steps, Constant(-1.0), break_when_any_done=False)


def training(n: int, physics: PhysicsConfig, steps: int) -> Callable[[], object]:
    config = TrainConfig(physics=physics, grasp=GraspConfig(steps=steps))
    config.ppo.grasps, config.ppo.initial_action = n, -1.0
    trainer = Trainer(config)
    batches = iter(trainer.collector)
    return lambda: trainer.algorithm.update(next(batches))


LEVELS = {"simulator": simulator, "environment": environment, "training": training}


def rates(n: int, physics: PhysicsConfig, steps: int, repeats: int) -> list[str]:
    """A row of the table: control steps per second of each level, and the seconds before the first step."""
    row, started = [f"{n:,}"], time.perf_counter()
    for level, make in LEVELS.items():
        run = make(n, physics, steps)
        if level == "simulator":
            row.append(f"{time.perf_counter() - started:.1f}")
        seconds = []
        for _ in range(repeats + 1):  # the first one warms up
            started = _now(physics)
            run()
            seconds.append(_now(physics) - started)
        row.append(f"{n * steps / min(seconds[1:]):,.0f}")
    return row


def deviation(physics: PhysicsConfig, steps: int) -> np.ndarray:
    """|Δf| between both engines while grasps close, newtons, ``(steps, COMPARED, 2)``."""
    grasps = GraspSampler(GraspConfig())(np.random.default_rng(0), np.arange(COMPARED))
    known, own = GraspSimulator(COMPARED, physics.tier), WarpGraspSimulator(COMPARED, physics.tier, physics.device)
    for one in (known, own):
        one.reset(grasps)
    found = []
    for _ in range(steps):
        known.step(np.full((COMPARED, 2), -0.003))
        own.step(torch.full((COMPARED, 2), -0.003, device=own.device))
        found.append(np.abs(known.force - own.force.cpu().numpy()))
    return np.stack(found)


def _now(physics: PhysicsConfig) -> float:
    if physics.device == "cuda":
        torch.cuda.synchronize()
    return time.perf_counter()


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", choices=("cuda", "cpu"), default="cuda")
    parser.add_argument("--grasps", type=int, nargs="+", default=[1024, 4096, 16384])
    parser.add_argument("--steps", type=int, default=150)
    parser.add_argument("--tier", choices=("fast", "reference"), default="fast")
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    physics = PhysicsConfig(options.tier, engine="warp", device=options.device)
    try:
        off = deviation(physics, options.steps)
    except ForcegraspError as error:
        raise SystemExit(f"bench_gpu: {error}") from error
    name = torch.cuda.get_device_name() if options.device == "cuda" else platform.processor() or "CPU"
    table = Table(title=f"{name}, {options.tier} physics, control steps per second")
    for heading in ("grasps", "set-up [s]", *LEVELS):
        table.add_column(heading, justify="right")
    for n in options.grasps:
        table.add_row(*rates(n, physics, options.steps, options.repeats))
    console = Console()
    console.print(table)
    console.print(f"forces against MuJoCo on the CPU: mean {off.mean() * 1e3:.4f} mN, largest {off.max() * 1e3:.2f} mN")


if __name__ == "__main__":
    main()
