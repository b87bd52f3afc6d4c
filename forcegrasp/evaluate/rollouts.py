"""Rolls a policy out over given grasps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torchrl.envs import TransformedEnv
from torchrl.envs.utils import ExplorationType, set_exploration_type

from forcegrasp.config import GraspConfig
from forcegrasp.env import build_env, with_memory
from forcegrasp.physics import FixedGrasps, GraspParameters

#: Grasps simulated at once; more would only take memory.
BATCH = 256


def roll_out(
    policy: TensorDictModuleBase,
    grasps: GraspParameters,
    grasp: GraspConfig,
    seed: int = 0,
    callback: Callable[[TransformedEnv, TensorDictBase], None] | None = None,
    **parts: Any,
) -> TensorDictBase:
    """Runs one deterministic episode of every grasp and returns them whole, batch ``(n, T)``, on the CPU.

    Args:
      policy: reads and writes tensordicts; a policy with a state brings its ``make_tensordict_primer()``.
      grasps: what to grasp.
      grasp: has the length of an episode.
      seed: seed of the sensor noise.
      callback: called after every control step, with the environment and its state.
      **parts: the rest of the environment's configuration, see :func:`~forcegrasp.env.build_env`.

    Raises:
      PhysicsError: if a grasp diverged.
    """
    episodes = []
    for first in range(0, len(grasps), BATCH):
        chunk = grasps[np.arange(first, min(first + BATCH, len(grasps)))]
        env = build_env(len(chunk), grasp=grasp, sampler=FixedGrasps(chunk), seed=seed + first, **parts)
        if isinstance(policy, torch.nn.Module):
            policy.to(env.device)
        with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
            env = with_memory(env, policy)
            rollout = env.rollout(grasp.steps, policy, callback, break_when_any_done=False)
            if callback is not None:  # which torchrl does not call after the last step
                callback(env, rollout[:, -1])
        # the stacked observation is most of the memory, and nobody looks at it afterwards
        episodes.append(rollout.exclude("observation", ("next", "observation")).cpu())
    return cast(TensorDictBase, torch.cat(episodes))
