"""Other stacks on the same grasp: a process for each grasp, each simulated by itself.

As in levels.py, a function prepares a peer and returns what runs it. Processes come from a fork server that has
imported what they need, the quickest and leanest way to start them.
"""

# pyright: reportMissingImports=false

from __future__ import annotations

import atexit
import multiprocessing
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from forcegrasp.config import PhysicsConfig, TrainConfig
from tools.bench.case import STEPS, Case
from tools.bench.levels import Run

if TYPE_CHECKING:
    import gymnasium
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import SubprocVecEnv

#: Steps of each environment in a batch of SB3, where it is timed: its 2,048 cost the same per step, but minutes.
SB3_STEPS = 160
SB3_MODULE = "stable_baselines3"


def view(physics: PhysicsConfig, seed: int, /) -> gymnasium.Env:
    """This project's environment behind gymnasium's interface."""
    from forcegrasp.env.gymnasium_view import GraspGymnasiumEnv

    return GraspGymnasiumEnv(seed, physics=physics)


def plain(physics: PhysicsConfig, seed: int, /) -> gymnasium.Env:
    """The same problem in plain numpy."""
    from tools.bench.plain_grasp import PlainGrasp

    return PlainGrasp(TrainConfig(physics=physics), seed)


MakeEnv = Callable[[PhysicsConfig, int], "gymnasium.Env"]
MODULES = {view: "forcegrasp.env.gymnasium_view", plain: "tools.bench.plain_grasp"}


def _closing(case: Case, envs: Any) -> Run:
    """Vectorised environments of either library that close at full speed."""
    envs.reset()
    actions = np.full((case.grasps, 2), -1.0, np.float32)

    def run() -> int:
        for _ in range(STEPS):
            envs.step(actions)
        return case.grasps * STEPS

    return run


def gymnasium_async(case: Case, make: MakeEnv) -> Run:
    """gymnasium's AsyncVectorEnv."""
    from gymnasium.vector import AsyncVectorEnv, AutoresetMode

    multiprocessing.set_forkserver_preload([MODULES[make]])
    envs = AsyncVectorEnv(_makers(case, make), context="forkserver", autoreset_mode=AutoresetMode.SAME_STEP)
    atexit.register(envs.close)
    return _closing(case, envs)


def torchrl_parallel(case: Case) -> Run:
    """torchrl's ParallelEnv of environments with a grasp each."""
    from torchrl.envs import ParallelEnv

    from forcegrasp.controllers import Constant
    from forcegrasp.env import build_env

    multiprocessing.set_forkserver_preload(["forcegrasp.env"])
    physics = PhysicsConfig(case.tier, 1)
    makers = [partial(build_env, 1, physics=physics, seed=seed) for seed in range(case.grasps)]
    env, close = ParallelEnv(case.grasps, makers, mp_start_method="forkserver"), Constant(-1.0)
    atexit.register(env.close, raise_if_closed=False)
    return lambda: env.rollout(STEPS, close, break_when_any_done=False).numel()


def sb3_stepping(case: Case, make: MakeEnv) -> Run:
    """Stable-Baselines3's SubprocVecEnv."""
    return _closing(case, sb3_envs(_makers(case, make), MODULES[make]))


def sb3_training(case: Case, make: MakeEnv) -> Run:
    """Stable-Baselines3's PPO, the authors' trainer, on a SubprocVecEnv."""
    import torch

    # as in levels.training, the policy closes and goes on closing
    model = sb3_ppo(sb3_envs(_makers(case, make), MODULES[make]), learning_rate=3e-5, n_steps=SB3_STEPS)
    parameters = dict(model.policy.named_parameters())
    torch.nn.init.constant_(parameters["action_net.bias"], -1.0)
    torch.nn.init.constant_(parameters["log_std"], -0.5)

    def run() -> int:
        model.learn(case.grasps * SB3_STEPS, reset_num_timesteps=False)
        return case.grasps * SB3_STEPS

    return run


def sb3_envs(makers: list[Callable[[], gymnasium.Env]], module: str) -> SubprocVecEnv:
    """A process for each environment, which needs ``module``."""
    from stable_baselines3.common.vec_env import SubprocVecEnv

    multiprocessing.set_forkserver_preload([module, "stable_baselines3.common.vec_env"])
    envs = SubprocVecEnv(makers, start_method="forkserver")
    atexit.register(envs.close)
    return envs


def sb3_ppo(envs: SubprocVecEnv, **options: Any) -> PPO:
    """PPO as the authors had it: two tanh layers of 50, learning rate 6e-4, else the defaults."""
    from stable_baselines3 import PPO

    defaults = {"learning_rate": 6e-4, "policy_kwargs": {"net_arch": [50, 50]}, "device": "cpu", "seed": 0}
    return PPO("MlpPolicy", envs, **(defaults | options))


def _makers(case: Case, make: MakeEnv) -> list[Callable[[], gymnasium.Env]]:
    return [partial(make, PhysicsConfig(case.tier, 1), seed) for seed in range(case.grasps)]


PEERS: dict[str, Callable[[Case], Run]] = {
    "gymnasium Async, our view": partial(gymnasium_async, make=view),
    "gymnasium Async, plain": partial(gymnasium_async, make=plain),
    "torchrl ParallelEnv": torchrl_parallel,
    "SB3 stepping, our view": partial(sb3_stepping, make=view),
    "SB3 stepping, plain": partial(sb3_stepping, make=plain),
    "SB3 training, our view": partial(sb3_training, make=view),
    "SB3 training, plain": partial(sb3_training, make=plain),
}


def rival(peer: str) -> str:
    """The level that does what this peer does."""
    return "training" if "training" in peer else "transformed env"


def missing(name: str) -> str:
    """The module that this level or peer needs and that is not installed, or nothing."""
    return SB3_MODULE if name.startswith("SB3") and find_spec(SB3_MODULE) is None else ""
