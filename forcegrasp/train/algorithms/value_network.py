"""Networks that estimate a state's or an action's value, from what the policy sees or also from the true state."""

from __future__ import annotations

from typing import cast

import torch
from tensordict.nn import TensorDictModule
from torch import Tensor, nn
from torchrl.modules import MLP

from forcegrasp.config import PPOConfig, SACConfig
from forcegrasp.controllers.tanh import Tanh
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import default_gripper

#: Entries of the true state that a privileged critic sees.
PRIVILEGED = ["grasp_parameters", "force", "joint_position", "object_position"]


class Value(nn.Module):
    """State value. Its output is scaled by the horizon 1 / (1 − γ), so that the network's own stays about 1.

    Attributes:
      horizon: that.
      is_privileged: whether it sees the true state.
    """

    middle: Tensor
    half_width: Tensor

    def __init__(
        self, observation_size: int, hidden: list[int], discount: float, privileged: bool, gripper: Gripper
    ) -> None:
        super().__init__()
        ranges = _parameter_ranges(gripper)
        self.is_privileged = privileged
        self.direct, self.stroke, self.force = gripper.is_direct, gripper.stroke, _large_force(gripper)
        extra = len(ranges) + 2 + len(gripper.motors) + 1 if privileged else 0
        self.net = MLP(
            in_features=observation_size + extra, out_features=1, num_cells=list(hidden), activation_class=Tanh
        )
        self.horizon = 1 / max(1 - discount, 1e-3)
        self.register_buffer("middle", torch.tensor([(low + high) / 2 for low, high in ranges]), persistent=False)
        half = [max((high - low) / 2, 1e-6) for low, high in ranges]
        self.register_buffer("half_width", torch.tensor(half), persistent=False)

    def forward(self, observation: Tensor, *state: Tensor) -> Tensor:
        """Of each state ``(*B, 1)``; ``state`` are the entries named ``PRIVILEGED``, if the network is privileged."""
        return self.of_seen(observation, self.true_state(*state) if state else None)

    def of_seen(self, observation: Tensor, true_state: Tensor | None = None) -> Tensor:
        """The same, of a :meth:`true_state` that is known."""
        seen = observation if true_state is None else torch.cat([observation, true_state], dim=-1)
        return self.horizon * self.net(seen)

    def true_state(self, parameters: Tensor, force: Tensor, position: Tensor, object_position: Tensor) -> Tensor:
        """What a privileged network sees beside the observation, ``(*B, extra)``: each about in [-1, 1]."""
        true = (parameters - self.middle) / self.half_width
        moved = (object_position - parameters[..., 3:4]) * 1000
        gap = self._gap(position, object_position, parameters[..., 2:3])
        return torch.cat([true, force / self.force, gap, moved], dim=-1)

    def _gap(self, position: Tensor, object_position: Tensor, radius: Tensor) -> Tensor:
        """True gap between each finger and the object's surface, in centimetres; else where the motors are."""
        if not self.direct:
            return 2 * position / self.stroke - 1
        side = torch.tensor([-1.0, 1.0], device=position.device)
        return (position - side * object_position - radius) * 100


class ActionValue(nn.Module):
    """Value of an action in a state: a :class:`Value` that sees the action beside the observation."""

    def __init__(self, value: Value) -> None:
        super().__init__()
        self.value = value
        nn.init.zeros_(cast(nn.Linear, value.net[-1]).weight)  # else the policy follows what no reward has said

    def forward(self, observation: Tensor, action: Tensor, *state: Tensor) -> Tensor:
        return self.value(torch.cat([observation, action], dim=-1), *state)


def _parameter_ranges(gripper: Gripper) -> list[tuple[float, float]]:
    """Where kappa, b2, radius, offset and goal force of a grasp usually lie, to bring them to about [-1, 1]."""
    training = gripper.training
    middle, depth = sum(training.offset_m) / 2, training.deformation_m
    offset = (middle - depth, middle + depth)
    return [(0.0, 1.0), training.servo_gain_range, training.radius_m, offset, (0.0, _large_force(gripper))]


def _large_force(gripper: Gripper) -> float:
    """Two thirds of the largest force of any object, newtons: few goals lie above."""
    return gripper.training.largest_force_n / 3 * 2


def make_value(observation_size: int, config: PPOConfig, gripper: Gripper | None = None) -> TensorDictModule:
    """The value network: reads ``observation`` (and the true state, if privileged), writes ``state_value``."""
    privileged = config.critic == "privileged"
    net = Value(observation_size, config.hidden, config.discount, privileged, gripper or default_gripper())
    return TensorDictModule(net, in_keys=["observation", *(PRIVILEGED if privileged else [])], out_keys=["state_value"])


def make_action_value(observation_size: int, config: SACConfig, gripper: Gripper) -> TensorDictModule:
    """As :func:`make_value`; reads ``action``, too, and writes ``state_action_value``."""
    privileged, size = config.critic == "privileged", observation_size + len(gripper.motors)
    # not in units of the horizon: a step of Adam would then outweigh what an action changes
    net = ActionValue(Value(size, config.hidden, 0.0, privileged, gripper))
    true_state = PRIVILEGED if privileged else []
    return TensorDictModule(net, in_keys=["observation", "action", *true_state], out_keys=["state_action_value"])
