"""The inductive bias φ that scales actions by the phase of the grasp (paper, eq. 7)."""

from __future__ import annotations

import torch
from jaxtyping import Float
from tensordict import TensorDictBase
from tensordict.utils import NestedKey
from torch import Tensor
from torchrl.envs.transforms import Transform


def contact_bias(
    had_contact: Float[Tensor, "*B channels"],
    force_error: Float[Tensor, "*B channels"],
    goal_force: Float[Tensor, "*B 1"],
    one: float,
    floor: float,
    motors: int,
    gentle_n: float = 0.0,
) -> Float[Tensor, "*B {motors}"]:
    """φ of each motor (paper, eq. 7).

    Where each motor has a force reading of its own: 1 before its finger's first contact; ``one`` for a finger that
    waits for the other; with both in contact ``max(floor, 1 − |Δf| / f_goal)``.

    Else, as with one motor for two fingers, all motors have the same φ: 1 until every reading has shown contact, and
    then ``max(floor, 1 − |Δf| / f_goal)`` of the mean error. Between the first and the second finger's touch nothing
    can wait: the motor closes on, and the finger that has touched pushes the object towards the other one.

    While one reading has shown contact and another one not, what still closes does so at ``√(f_goal / gentle_n)`` of
    its speed where less than ``gentle_n`` is asked for: what a touch presses beyond the goal grows with the speed, and
    a small goal feels it most (own form).

    Args:
      had_contact: h, 0 or 1, ``(*B, channels)``.
      force_error: Δf, newtons, ``(*B, channels)``.
      goal_force: f_goal, newtons, ``(*B, 1)``.
      one, floor: as above.
      motors: how many.
      gentle_n: newtons; 0 for full speed whatever the goal.

    Returns:
      ``(*B, motors)``, in [0, 1].
    """
    touched = had_contact > 0.5
    all_touched = touched.all(-1, keepdim=True)
    closing = torch.ones_like(goal_force)
    if gentle_n:
        slower = (goal_force / gentle_n).sqrt().clamp_max(1)
        closing = torch.where(touched.any(-1, keepdim=True), slower, closing)
    if touched.shape[-1] != motors:
        error = force_error.abs().mean(-1, keepdim=True)
        near_goal = (1 - error / goal_force).clamp_min(floor)
        return torch.where(all_touched, near_goal, closing).expand(*near_goal.shape[:-1], motors)
    near_goal = (1 - force_error.abs() / goal_force).clamp_min(floor)
    waiting = torch.where(touched, one, closing) if motors > 1 else closing
    return torch.where(all_touched, near_goal, waiting)


class InductiveBias(Transform):
    """Multiplies the position delta by φ, from contact memory and force error of the same step.

    Only what the environment receives is scaled: the stored action stays the policy's own, so its log-probability
    stays valid. Append it before :class:`ActionScale`: inverses run last-appended first.

    Args:
      one: φ of a finger that waits for the other.
      floor: smallest φ with both fingers in contact.
      gentle_n: goal below which the last finger to touch closes slower, newtons; 0: never.
      delta_key: the quantity to scale, ``(*B, motors)``.
    """

    def __init__(
        self,
        one: float = 0.1,
        floor: float = 0.9,
        gentle_n: float = 0.0,
        delta_key: NestedKey = "joint_delta",
        had_contact_key: NestedKey = "had_contact",
        force_error_key: NestedKey = "force_error",
        goal_key: NestedKey = "goal_force",
    ) -> None:
        super().__init__(in_keys_inv=[delta_key], out_keys_inv=[delta_key])
        self.one, self.floor, self.gentle_n = one, floor, gentle_n
        self.state_keys = (had_contact_key, force_error_key, goal_key)

    def _inv_call(self, tensordict: TensorDictBase) -> TensorDictBase:
        had_contact, force_error, goal = (tensordict[key] for key in self.state_keys)
        delta = tensordict[self.out_keys_inv[0]]
        phi = contact_bias(had_contact, force_error, goal, self.one, self.floor, delta.shape[-1], self.gentle_n)
        return tensordict.set(self.in_keys_inv[0], delta * phi)
