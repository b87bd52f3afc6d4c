"""Where the time goes: raw engine → simulator → env → transformed env → collection → training, as ratios of one run.

python tools/bench.py [--grasps 256] [--tier fast] [--threads 0] [--repeats 3] [--json FILE]

Every level simulates the same thing, whole episodes of grasps that close at full speed: contact is what costs time.
The levels take turns, and the best of their repeats counts, so that whatever else the machine does hits all alike.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from collections.abc import Callable

import numpy as np
import torch
from mujoco.batch import Batch
from rich.console import Console
from rich.table import Table

warnings.filterwarnings("ignore", category=DeprecationWarning)
from forcegrasp.config import GraspConfig, PhysicsConfig, TrainConfig  # noqa: E402
from forcegrasp.controllers import Constant  # noqa: E402
from forcegrasp.env import GraspEnv, build_env  # noqa: E402
from forcegrasp.physics import GraspSampler, GraspSimulator  # noqa: E402
from forcegrasp.train.loop import Trainer  # noqa: E402

STEPS = 150


def raw_engine(n: int, physics: PhysicsConfig) -> Callable[[], object]:
    """MuJoCo's own rollout over a recorded sequence of commands: no Python between the physics steps."""
    simulator = _closed_simulator(n, physics)
    substeps = round(0.04 / simulator.model.opt.timestep)
    commands = np.empty((n, STEPS, 2))
    for step in range(STEPS):
        simulator.step(np.full((n, 2), -0.003))
        commands[:, step] = simulator.commanded_position
    models = [simulator.scene(i)[0] for i in range(n)]
    batch = Batch(simulator.model, n, physics.threads)
    batch.set_models(models)
    offsets = simulator.parameters.offset_m
    control = commands.repeat(substeps, axis=1)

    def run() -> None:
        batch.reset(keyframe=0)
        batch.bind("qpos")[:, 1] = offsets
        batch.rollout(STEPS * substeps, control, record=["ctrl"])

    return run


def simulator_loop(n: int, physics: PhysicsConfig) -> Callable[[], object]:
    simulator = _closed_simulator(n, physics)
    delta = np.full((n, 2), -0.003)

    def run() -> None:
        simulator.reset(simulator.parameters)
        for _ in range(STEPS):
            simulator.step(delta)

    return run


def env_loop(n: int, physics: PhysicsConfig) -> Callable[[], object]:
    env = GraspEnv(n, physics)

    def close(tensordict):
        return tensordict.set("joint_delta", torch.full((n, 2), -0.003))

    return lambda: env.rollout(STEPS, close, break_when_any_done=False)


def transformed_env_loop(n: int, physics: PhysicsConfig) -> Callable[[], object]:
    env, close = build_env(n, physics=physics), Constant(-1.0)
    return lambda: env.rollout(STEPS, close, break_when_any_done=False)


def _closing_trainer(n: int, physics: PhysicsConfig) -> Trainer:
    config = TrainConfig(physics=physics)
    config.ppo.grasps = n
    config.curriculum.enabled = False
    trainer = Trainer(config)
    last = [module for module in trainer.policy.modules() if isinstance(module, torch.nn.Linear)][-1]
    torch.nn.init.constant_(last.bias, -1.0)
    trainer.ppo.set_progress(1.0)  # small steps: it should go on closing
    return trainer


def collection(n: int, physics: PhysicsConfig) -> Callable[[], object]:
    batches = iter(_closing_trainer(n, physics).collector())
    return lambda: next(batches)


def training(n: int, physics: PhysicsConfig) -> Callable[[], object]:
    trainer = _closing_trainer(n, physics)
    batches = iter(trainer.collector())
    return lambda: trainer.ppo.update(next(batches), trainer.shuffle)


LEVELS = {
    "raw engine": raw_engine,
    "simulator": simulator_loop,
    "env": env_loop,
    "transformed env": transformed_env_loop,
    "collection": collection,
    "training": training,
}


def _closed_simulator(n: int, physics: PhysicsConfig) -> GraspSimulator:
    simulator = GraspSimulator(n, physics.tier, physics.threads)
    simulator.reset(GraspSampler(GraspConfig())(np.random.default_rng(0), np.arange(n)))
    return simulator


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--grasps", type=int, default=256)
    parser.add_argument("--tier", choices=("fast", "reference"), default="fast")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--json")
    options = parser.parse_args()
    torch.set_num_threads(1)
    physics = PhysicsConfig(options.tier, options.threads)
    runs = {name: make(options.grasps, physics) for name, make in LEVELS.items()}
    best = dict.fromkeys(runs, float("inf"))
    for repeat in range(options.repeats + 1):
        for name, run in runs.items():
            started = time.perf_counter()
            run()
            if repeat:  # the first round warms up
                best[name] = min(best[name], time.perf_counter() - started)
    rates = {name: options.grasps * STEPS / seconds for name, seconds in best.items()}
    table = Table(title=f"{options.grasps} grasps, {options.tier} physics, control steps per second")
    for heading in ("level", "steps/s", "of the raw engine"):
        table.add_column(heading, justify="left" if heading == "level" else "right")
    for name, rate in rates.items():
        table.add_row(name, f"{rate:,.0f}", f"{rate / rates['raw engine']:.2f}")
    Console().print(table)
    if options.json:
        with open(options.json, "w") as file:
            json.dump({**vars(options), "steps_per_second": rates}, file, indent=1)


if __name__ == "__main__":
    main()
