"""The layers of this project, lowest first. Each function prepares one and returns what runs it.

All simulate the same thing, whole episodes of grasps that close at full speed: contact is what costs time. What runs
a layer returns the control steps it simulated. Imports are local: the lower layers know no torch, and should not pay
for it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from forcegrasp.config import GraspConfig, PhysicsConfig, TrainConfig
from tools.bench.case import STEPS, Case

if TYPE_CHECKING:
    from forcegrasp.physics import GraspSimulator
    from forcegrasp.train.loop import Trainer

Run = Callable[[], int]
#: Of the training that is timed.
BATCHES = 6


def raw_engine(case: Case) -> Run:
    """MuJoCo's own rollout over a recorded sequence of commands: no Python between the physics steps."""
    from mujoco.batch import Batch

    simulator = _closed_simulator(case)
    substeps = round(0.04 / simulator.model.opt.timestep)
    commands = np.empty((case.grasps, STEPS, 2))
    for step in range(STEPS):
        simulator.step(np.full((case.grasps, 2), -0.003))
        commands[:, step] = simulator.commanded_position
    models = [simulator.scene(i)[0] for i in range(case.grasps)]
    batch = Batch(simulator.model, case.grasps, case.threads)
    batch.set_models(models)
    offsets = simulator.parameters.offset_m
    control = commands.repeat(substeps, axis=1)

    def run() -> int:
        batch.reset(keyframe=0)
        batch.bind("qpos")[:, 1] = offsets
        batch.rollout(STEPS * substeps, control, record=["ctrl"])
        return case.grasps * STEPS

    return run


def simulator_loop(case: Case) -> Run:
    """The batched simulator: a command per grasp in, positions and forces out."""
    simulator = _closed_simulator(case)
    delta = np.full((case.grasps, 2), -0.003)

    def run() -> int:
        simulator.reset(simulator.parameters)
        for _ in range(STEPS):
            simulator.step(delta)
        return case.grasps * STEPS

    return run


def env_loop(case: Case) -> Run:
    """The TorchRL environment: clean state and reward."""
    import torch

    from forcegrasp.env import GraspEnv

    env = GraspEnv(case.grasps, PhysicsConfig(case.tier, case.threads))

    def close(tensordict):
        return tensordict.set("joint_delta", torch.full((case.grasps, 2), -0.003))

    return lambda: env.rollout(STEPS, close, break_when_any_done=False).numel()


def transformed_env_loop(case: Case) -> Run:
    """The environment with noise, memory, stacking and bias: what a policy acts on."""
    from forcegrasp.controllers import Constant
    from forcegrasp.env import build_env

    env, close = build_env(case.grasps, physics=PhysicsConfig(case.tier, case.threads)), Constant(-1.0)
    return lambda: env.rollout(STEPS, close, break_when_any_done=False).numel()


def collection(case: Case) -> Run:
    """A policy that closes, and its batches of episodes."""
    batches = iter(_closing_trainer(case).collector)
    return lambda: next(batches).numel()


def training(case: Case) -> Run:
    """A short training: collection, and PPO's updates on each batch beside it."""
    trainer = _closing_trainer(case)
    trainer.next_batch.ahead = True
    trainer.algorithm.total_frames = BATCHES * trainer.algorithm.frames_per_batch

    def run() -> int:
        trainer.frames = 0
        while trainer.frames < trainer.algorithm.total_frames:  # nothing is collected ahead for another turn
            batch = trainer.collect()[0]
            trainer.algorithm.update(batch)
            trainer.frames += batch.numel()
        return trainer.frames

    return run


LEVELS: dict[str, Callable[[Case], Run]] = {
    "raw engine": raw_engine,
    "simulator": simulator_loop,
    "env": env_loop,
    "transformed env": transformed_env_loop,
    "collection": collection,
    "training": training,
}


def _closed_simulator(case: Case) -> GraspSimulator:
    from forcegrasp.physics import GraspSampler, GraspSimulator

    simulator = GraspSimulator(case.grasps, case.tier, case.threads)
    simulator.reset(GraspSampler(GraspConfig())(np.random.default_rng(0), np.arange(case.grasps)))
    return simulator


def _closing_trainer(case: Case) -> Trainer:
    import torch

    from forcegrasp.train.loop import Trainer

    config = TrainConfig(physics=PhysicsConfig(case.tier, case.threads))
    config.ppo.grasps = case.grasps
    config.curriculum.enabled = False
    trainer = Trainer(config)
    last = [module for module in trainer.policy.modules() if isinstance(module, torch.nn.Linear)][-1]
    torch.nn.init.constant_(last.bias, -1.0)
    trainer.algorithm.set_progress(1.0)  # small steps: it should go on closing
    return trainer
