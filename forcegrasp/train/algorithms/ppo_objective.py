"""What a gradient step of proximal policy optimisation lowers (Schulman et al. 2017)."""

from __future__ import annotations

import math
from collections.abc import Mapping

import torch
from tensordict.utils import NestedKey
from torch import Tensor

from forcegrasp.config import PPOConfig
from forcegrasp.train.algorithms.teacher import imitation_loss


class Objective:
    """The clipped surrogate, the value network's error, and what the options add to them.

    Attributes:
      teacher_weight: of a student's errors; 0 without a teacher. It falls while training.

    Args:
      options: weights of the terms.
      horizon: 1 / (1 − γ). Value errors are in units of it: in units of reward they would drown the policy's.
    """

    def __init__(self, options: PPOConfig, horizon: float) -> None:
        self.options, self.horizon = options, horizon
        self.teacher_weight = options.teacher_weight

    def __call__(
        self, frames: Mapping[NestedKey, Tensor], loc: Tensor, scale: Tensor, log_ratio: Tensor, value: Tensor
    ) -> tuple[Tensor, dict[str, Tensor]]:
        """Its value on a minibatch, and its parts and diagnostics.

        Args:
          frames: the minibatch.
          loc: mean of the policy's actions now, ``(*B, motors)``.
          scale: their standard deviation.
          log_ratio: logarithm of the probability of the actions now over that when they were taken, ``(n,)``.
          value: of the states, ``(*B, 1)``.
        """
        options = self.options
        told = clipped_loss(log_ratio, frames["advantage"].flatten(), self.bounds)
        told["loss_critic"] = options.value_weight * (value - frames["value_target"]).square().mean()
        objective = told["loss_objective"] + told["loss_critic"] / self.horizon**2
        if options.entropy_weight:
            objective = objective - options.entropy_weight * entropy(scale)
        if options.teacher_weight:
            told["loss_teacher"] = imitation_loss(loc, frames, options.teacher_caution)
            objective = objective + self.teacher_weight * told["loss_teacher"]
        return objective, told

    @property
    def bounds(self) -> tuple[float, float]:
        """Between which a ratio's logarithm counts."""
        return math.log1p(-self.options.clip), math.log1p(self.options.clip)


def clipped_loss(log_ratio: Tensor, advantage: Tensor, bounds: tuple[float, float]) -> dict[str, Tensor]:
    """The clipped surrogate (Schulman et al. 2017, eq. 7) and its diagnostics, as torchrl's ``ClipPPOLoss`` has them.

    Its tensordicts, and modules with parameters put into them, would take longer than these few numbers.

    Args:
      log_ratio: logarithm of the probability of each action now over that when it was taken, ``(n,)``.
      advantage: of each action, ``(n,)``.
      bounds: between which the logarithm counts, of 1 − ε and 1 + ε.
    """
    clipped = log_ratio.clamp(*bounds)
    gain = torch.minimum(log_ratio.exp() * advantage, clipped.exp() * advantage)
    with torch.no_grad():
        relative = (log_ratio - log_ratio.max()).exp()  # squares of ratios may be beyond any number
        effective = relative.sum().square() / relative.square().sum() / len(relative)
        share = (clipped != log_ratio).float().mean()
        divergence = -log_ratio.mean()
    return {"loss_objective": -gain.mean(), "kl_approx": divergence, "clip_fraction": share, "ESS": effective}


def entropy(scale: Tensor) -> Tensor:
    """Mean differential entropy of the policy's Gaussian, in nats, from its standard deviations ``(*B, motors)``."""
    return (scale.log() + 0.5 * math.log(2 * math.pi * math.e)).sum(-1).mean()
