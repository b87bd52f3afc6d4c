"""The gradient of PPO's objective for networks of tanh layers, written out.

For networks this small autograd takes as long again for what it records of each operation. What is lowered is said by
:class:`~.ppo_objective.Objective`; a test holds this to autograd's gradient of that, on every preset.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

import numpy as np
import torch
from tensordict.nn import AddStateIndependentNormalScale
from tensordict.utils import NestedKey
from torch import Tensor, nn
from torchrl.modules import MLP, ProbabilisticActor

from forcegrasp.controllers.mean_network import Mirrored, SqueezeTogether
from forcegrasp.controllers.policy import log_prob
from forcegrasp.controllers.tanh import Tanh
from forcegrasp.train.algorithms.ppo_objective import Objective
from forcegrasp.train.algorithms.teacher import imitation_slope
from forcegrasp.train.algorithms.value_network import Value


def can_be_written(policy: ProbabilisticActor, critic: Value) -> bool:
    """Whether :class:`WrittenGradient` has the gradient of these networks: without memory."""
    networks = policy[0].module
    return isinstance(networks, nn.Sequential) and is_plain(networks[0]) and is_plain(critic.net)


def is_plain(net: nn.Module) -> bool:
    """Whether it is what :class:`Mean` is made for: tanh layers, and what may be around them, on the CPU in float32."""
    layers = _layers_of(net)
    plain = type(layers) is MLP and {type(module) for module in layers} <= {nn.Linear, Tanh}
    return plain and all(p.device.type == "cpu" and p.dtype is torch.float32 for p in net.parameters())


class WrittenGradient:
    """Writes each parameter's ``grad``, which must be there.

    Args:
      policy, critic: whose parameters they are.
      objective: what is lowered.
    """

    def __init__(self, policy: ProbabilisticActor, critic: Value, objective: Objective) -> None:
        mean, deviation = cast(nn.Sequential, policy[0].module)
        self.mean, self.deviation = Mean(mean), cast(AddStateIndependentNormalScale, deviation)
        self.value, self.horizon, self.objective = Layers(critic.net), critic.horizon, objective

    @torch.no_grad()
    def __call__(self, frames: Mapping[NestedKey, Tensor]) -> dict[str, Tensor]:
        """Returns the objective's parts on a minibatch, as :class:`Objective` does."""
        objective, options = self.objective, self.objective.options
        observation, action, n = frames["observation"], frames["action"], len(frames["action"])
        seen = torch.cat([observation, frames["true_state"]], -1) if "true_state" in frames else observation
        loc, scale = self.deviation(self.mean.forward(observation))
        value = self.horizon * self.value.forward(seen)
        log_ratio = log_prob(action, loc, scale) - frames["action_log_prob"].flatten()
        told = objective(frames, loc, scale, log_ratio, value)[1]

        advantage, z = frames["advantage"].flatten(), (action - loc) / scale
        gain, clipped = log_ratio.exp() * advantage, log_ratio.clamp(*objective.bounds).exp() * advantage
        by_log_ratio = torch.where(gain <= clipped, gain, 0.0).unsqueeze(-1) / -n
        by_loc = by_log_ratio * z / scale
        if options.teacher_weight:
            by_loc += objective.teacher_weight * imitation_slope(loc, frames, options.teacher_caution)
        by_log_scale = (by_log_ratio * (z.square() - 1)).sum(0) - options.entropy_weight
        free = scale[0] > self.deviation.scale_lb  # held at its bound nothing moves it
        torch.mul(by_log_scale, free, out=self.deviation.state_independent_scale.grad)
        self.mean.backward(by_loc)
        error = value - frames["value_target"]
        self.value.backward(error * (2 * options.value_weight / (n * self.horizon)))
        return told


class Layers:
    """A tanh network ``(n, in) -> (n, out)``.

    Args:
      net: linear layers with a tanh between any two.
    """

    def __init__(self, net: nn.Module) -> None:
        self.layers = [module for module in net.modules() if isinstance(module, nn.Linear)]
        self.seen: list[Tensor] = []

    def forward(self, x: Tensor) -> Tensor:
        """Its output; what each layer saw is kept."""
        self.seen = [x]
        for layer in self.layers[:-1]:
            x = torch.addmm(layer.bias, x, layer.weight.t())
            np.tanh(x.numpy(), out=x.numpy())
            self.seen.append(x)
        return torch.addmm(self.layers[-1].bias, x, self.layers[-1].weight.t())

    def backward(self, slope: Tensor) -> None:
        """Writes the weights' gradients, from that with respect to the output, ``(n, out)``."""
        for layer, x in zip(reversed(self.layers), reversed(self.seen), strict=True):
            torch.mm(slope.t(), x, out=layer.weight.grad)
            torch.sum(slope, 0, out=layer.bias.grad)
            if x is not self.seen[0]:
                slope = torch.ops.aten.tanh_backward(slope.mm(layer.weight), x)


class Mean:
    """A policy's mean action, ``(n, size) -> (n, motors)``: layers that may be mirrored, and may squeeze together."""

    def __init__(self, mean: nn.Module) -> None:
        self.squeeze = mean if isinstance(mean, SqueezeTogether) else None
        inner = mean.net if isinstance(mean, SqueezeTogether) else mean
        self.mirrored = inner if isinstance(inner, Mirrored) else None
        self.layers = Layers(_layers_of(mean))

    def forward(self, observation: Tensor) -> Tensor:
        if self.mirrored is None:
            action = self.layers.forward(observation)
        else:
            both = torch.cat([observation, self.mirrored.mirror(observation)])
            own, mirrored = self.layers.forward(both).chunk(2)
            action = (own + mirrored.flip(-1)) / 2
        if self.squeeze is not None:
            self.grasped = self.squeeze.grasped(observation)
            action = torch.where(self.grasped, action.mean(-1, keepdim=True), action)
        return action

    def backward(self, slope: Tensor) -> None:
        if self.squeeze is not None:
            slope = torch.where(self.grasped, slope.mean(-1, keepdim=True), slope)
        if self.mirrored is not None:
            slope = torch.cat([slope, slope.flip(-1)]) / 2
        self.layers.backward(slope)


def _layers_of(mean: nn.Module) -> nn.Module:
    """The layers of a mean, without what is around them."""
    return _layers_of(mean.net) if isinstance(mean, Mirrored | SqueezeTogether) else mean
