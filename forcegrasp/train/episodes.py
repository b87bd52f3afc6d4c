"""Whole episodes of a training env, step by step as TorchRL's collector takes them, less what its generality costs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, cast

import torch
from tensordict import TensorDict
from tensordict.utils import NestedKey
from torch import Tensor, nn
from torchrl.envs import EnvBase, TransformedEnv
from torchrl.envs.transforms import CatFrames, CatTensors, Compose, ObservationNorm, Transform
from torchrl.envs.utils import ExplorationType, set_exploration_type
from torchrl.modules import IndependentNormal, ProbabilisticActor

from forcegrasp.controllers.policy import log_prob
from forcegrasp.env import GraspEnv
from forcegrasp.train.algorithms.written_gradient import Mean, is_plain
from forcegrasp.train.entries import Entries

#: A step's entries by key, nested ones by their path.
Step = dict[NestedKey, Tensor]
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
    known = all(_is_known(transform) for transform in transforms)
    act = Gaussian(policy) if _is_gaussian(policy) else partial(_act, policy)
    start = env.reset()
    state: Step = {key: start.get(key) for key in start.keys(True, True)}
    chosen, states = list[Step](), [state]
    with set_exploration_type(ExplorationType.RANDOM):
        for _ in range(steps):
            acted = act(state)
            chosen.append(acted)
            inward: Any = Entries({**state, **acted})
            inward = inward if known else TensorDict(inward, batch_size=env.batch_size)
            for transform in reversed(transforms):
                inward = transform._inv_call(inward)
            after: Any = simulation.advance(inward.get("joint_delta"))
            after = Entries(after) if known else TensorDict(after, batch_size=env.batch_size)
            for transform in transforms:
                after = transform._step(inward, after)
            led_to: Step = after if known else {key: after.get(key) for key in after.keys(True, True)}
            states.append(led_to)
            state = {key: value for key, value in led_to.items() if key not in RESULTS}
    batch = _batch(chosen, states, env.batch_size[0], steps)
    if isinstance(act, Gaussian):  # of all steps at once, which costs less than a step at a time
        batch["action_log_prob"] = log_prob(batch["action"], batch["loc"], batch["scale"])
    return batch


class Gaussian:
    """A Gaussian policy without memory: draws as it would itself, but builds no distribution.

    Args:
      policy: whose weights do not change meanwhile.
    """

    def __init__(self, policy: ProbabilisticActor) -> None:
        mean, self.deviation = cast(nn.Sequential, policy[0].module)
        self.mean = Mean(mean).forward if is_plain(mean) else mean

    def __call__(self, state: Step) -> Step:
        """Mean, standard deviation and action, ``(n, motors)`` each."""
        loc, scale = self.deviation(self.mean(state["observation"]))
        return {"loc": loc, "scale": scale, "action": torch.normal(loc, scale)}


def _is_gaussian(policy: ProbabilisticActor) -> bool:
    return policy[-1].distribution_class is IndependentNormal and isinstance(policy[0].module, nn.Sequential)


def _act(policy: ProbabilisticActor, state: Step) -> Step:
    """All that a policy writes."""
    seen = TensorDict(dict(state), batch_size=next(iter(state.values())).shape[:1])
    acted = policy(seen)
    return {key: acted.get(key) for key in set(acted.keys(True, True)) - set(state)}


def _is_known(transform: Transform) -> bool:
    """Whether all that it asks of a tensordict is what :class:`Entries` have."""
    own = type(transform).__module__.startswith("forcegrasp.transforms.")
    return own or type(transform) in (CatFrames, CatTensors, ObservationNorm)


def _transforms(env: TransformedEnv) -> list[Transform]:
    chain = env.transform
    return list(chain) if isinstance(chain, Compose) else [chain]


def _batch(chosen: Sequence[Step], states: Sequence[Step], n: int, steps: int) -> TensorDict:
    """Entries of every step as ``(n, steps, ...)``."""
    batch, after = TensorDict(batch_size=[n, steps]), TensorDict(batch_size=[n, steps])
    for key in states[0]:
        every = torch.stack([state[key] for state in states], 1)
        batch.set(key, every[:, :-1])
        after.set(key, every[:, 1:])
    for key in RESULTS:
        after.set(key, torch.stack([state[key] for state in states[1:]], 1))
    for key in chosen[0]:
        batch.set(key, torch.stack([state[key] for state in chosen], 1))
    return batch.set("next", after)
