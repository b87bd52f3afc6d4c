"""The reward's terms, one function each, and their names. Torch in, torch out; no state."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor


def force_reward(force_error: Float[Tensor, "*B channels"]) -> Float[Tensor, "*B 1"]:
    """r_force = 1 − tanh(Σ_i |Δf_i|) (paper, eq. 8).

    Args:
      force_error: Δf = f_goal − f of each force, newtons, ``(*B, channels)``.

    Returns:
      ``(*B, 1)``, in [0, 1], 1 where both forces equal the goal.
    """
    return 1 - torch.tanh(force_error.abs().sum(-1, keepdim=True))


def normalised_force_reward(
    force_error: Float[Tensor, "*B channels"], goal_force: Float[Tensor, "*B 1"]
) -> Float[Tensor, "*B 1"]:
    """r_force = 1 − tanh(Σ_i |Δf_i| / f_goal), the form that trained the published policies (authors' code).

    Args:
      force_error: newtons, ``(*B, channels)``.
      goal_force: newtons, ``(*B, 1)``.

    Returns:
      ``(*B, 1)``, in [0, 1].
    """
    return force_reward(force_error / goal_force)


def overshoot_penalty(
    force: Float[Tensor, "*B sides"], goal_force: Float[Tensor, "*B 1"], margin: float
) -> Float[Tensor, "*B 1"]:
    """r_over = −Σ_i max(0, f_i / f_goal − 1 − margin), own form: linear, as the damage of a squeeze grows with it.

    r_force can't replace it: tanh is flat where a force is far beyond the goal, and both signs of Δf count alike.

    Args:
      force: f, newtons, ``(*B, sides)``.
      goal_force: newtons, ``(*B, 1)``.
      margin: what may be exceeded freely, as a fraction of the goal.

    Returns:
      ``(*B, 1)``, 0 at best.
    """
    return -(force / goal_force - 1 - margin).clamp_min(0).sum(-1, keepdim=True)


def object_penalty(object_speed: Float[Tensor, "*B 1"], threshold: float) -> Float[Tensor, "*B 1"]:
    """r_obj = −1 where the object moves faster than the threshold, else 0 (paper, eq. 9).

    Args:
      object_speed: metres per control step, ``(*B, 1)``.
      threshold: metres per control step.

    Returns:
      ``(*B, 1)``.
    """
    return -(object_speed > threshold).to(object_speed.dtype)
