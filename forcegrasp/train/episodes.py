"""Whole episodes of a training env, step by step as TorchRL's collector takes them, less what its generality costs."""

from __future__ import annotations

from typing import cast

import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModule
from torchrl.envs import EnvBase, TransformedEnv
from torchrl.envs.transforms import Compose, Transform
from torchrl.envs.utils import ExplorationType, set_exploration_type
from torchrl.modules import IndependentNormal, ProbabilisticActor

from forcegrasp.controllers.policy import log_prob
from forcegrasp.env import GraspEnv

#: What a step writes that the next one does not start from.
RESULTS = ("reward",)


def can_collect(env: EnvBase, policy: ProbabilisticActor) -> bool:
    """Whether :func:`collect` does with these what TorchRL's collector would, to the last bit.

    It does not where a transform changes what the step after starts from, or the policy hands something on to it.
    """
    if not (isinstance(env, TransformedEnv) and isinstance(env.base_env, GraspEnv)):
        return False
    transforms = _transforms(env)
    plain = all(type(t)._post_step_mdp_hooks is Transform._post_step_mdp_hooks for t in transforms)
    carried = not env.state_spec.is_empty() or any(isinstance(key, tuple) for key in policy.out_keys)
    return plain and not carried


@torch.no_grad()
def collect(env: TransformedEnv, policy: ProbabilisticActor, steps: int) -> TensorDict:
    """Resets all grasps and takes so many steps, each transform's own ``_inv_call`` and ``_step`` in their order.

    Returns:
      The batch ``(n, steps)`` that TorchRL's collector makes of the same random state. What a step starts from and
      what the one before led to share their memory.
    """
    simulation, transforms = cast(GraspEnv, env.base_env), _transforms(env)
    state: TensorDictBase = env.reset()
    gaussian = policy[-1].distribution_class is IndependentNormal and len(policy.module) == 2
    chosen, states = [], [state.clone(False)]
    with set_exploration_type(ExplorationType.RANDOM):
        for _ in range(steps):
            if gaussian:
                _act(policy, state)
            else:
                policy(state)
            chosen.append(state)
            inward = state.clone(False)
            for transform in reversed(transforms):
                inward = transform._inv_call(inward)
            after: TensorDictBase = simulation._step(inward)
            for transform in transforms:
                after = transform._step(inward, after)
            states.append(after)
            state = after.exclude(*RESULTS)
    batch = _batch(chosen, states, env.batch_size[0], steps)
    if gaussian:  # of all steps at once, which costs less than a step at a time
        batch["action_log_prob"] = log_prob(batch["action"], batch["loc"], batch["scale"])
    return batch


def _act(policy: ProbabilisticActor, state: TensorDictBase) -> None:
    """Draws the actions of a Gaussian policy as it would itself, without building a distribution."""
    module = cast(TensorDictModule, policy[0])
    loc, scale = module.module(*(state.get(key) for key in module.in_keys))
    state.update({"loc": loc, "scale": scale, "action": torch.normal(loc, scale)})


def _transforms(env: TransformedEnv) -> list[Transform]:
    chain = env.transform
    return list(chain) if isinstance(chain, Compose) else [chain]


def _batch(chosen: list[TensorDictBase], states: list[TensorDictBase], n: int, steps: int) -> TensorDict:
    """Entries of every step as ``(n, steps, ...)``."""
    batch, after = TensorDict(batch_size=[n, steps]), TensorDict(batch_size=[n, steps])
    for key in states[0].keys(True, True):
        every = torch.stack([state.get(key) for state in states], 1)
        batch.set(key, every[:, :-1])
        after.set(key, every[:, 1:])
    for key in RESULTS:
        after.set(key, torch.stack([state.get(key) for state in states[1:]], 1))
    for key in set(chosen[0].keys(True, True)) - set(states[0].keys(True, True)):
        batch.set(key, torch.stack([state.get(key) for state in chosen], 1))
    return batch.set("next", after)
