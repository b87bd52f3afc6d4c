"""The inductive bias φ that scales actions by the phase of the grasp (paper, eq. 7)."""

from __future__ import annotations

import torch
from jaxtyping import Float
from tensordict import TensorDictBase
from tensordict.utils import NestedKey
from torch import Tensor
from torchrl.envs.transforms import Transform

from forcegrasp.deploy.contract import LAST_TOUCH


def contact_bias(
    had_contact: Float[Tensor, "*B channels"],
    force_error: Float[Tensor, "*B channels"],
    goal_force: Float[Tensor, "*B 1"],
    one: float,
    floor: float,
    motors: int,
    closing: Float[Tensor, "*B 1"] | None = None,
) -> Float[Tensor, "*B {motors}"]:
    """φ of each motor (paper, eq. 7).

    Where each motor has a force reading of its own: 1 before its finger's first contact; ``one`` for a finger that
    waits for the other; with both in contact ``max(floor, 1 − |Δf| / f_goal)``.

    Else, as with one motor for two fingers, all motors have the same φ: 1 until every reading has shown contact, and
    then ``max(floor, 1 − |Δf| / f_goal)`` of the mean error. Between the first and the second finger's touch nothing
    can wait: the motor closes on, and the finger that has touched pushes the object towards the other one.

    Args:
      had_contact: h, 0 or 1, ``(*B, channels)``.
      force_error: Δf, newtons, ``(*B, channels)``.
      goal_force: f_goal, newtons, ``(*B, 1)``.
      one, floor: as above.
      motors: how many.
      closing: φ of what still closes, ``(*B, 1)``, as :func:`gentle_closing` has it; 1 by default.

    Returns:
      ``(*B, motors)``, in [0, 1].
    """
    touched = had_contact > 0.5
    all_touched = touched.all(-1, keepdim=True)
    closing = torch.ones_like(goal_force) if closing is None else closing
    if touched.shape[-1] != motors:
        error = force_error.abs().mean(-1, keepdim=True)
        near_goal = (1 - error / goal_force).clamp_min(floor)
        return torch.where(all_touched, near_goal, closing).expand(*near_goal.shape[:-1], motors)
    near_goal = (1 - force_error.abs() / goal_force).clamp_min(floor)
    waiting = torch.where(touched, one, closing) if motors > 1 else closing
    return torch.where(all_touched, near_goal, waiting)


def gentle_closing(
    goal_force: Float[Tensor, "*B 1"], touch_force: Float[Tensor, "*B 1"], gentle_n: float
) -> Float[Tensor, "*B 1"]:
    """φ of the last finger to touch, ``min(1, √(f_goal / min(2 p, gentle_n)))`` (own form).

    What a touch presses beyond the goal grows with the speed and with the object's hardness, of which the first touch
    tells; a small goal feels it most. Before the first touch p = 0, and φ = 1.

    Args:
      goal_force: f_goal, newtons, ``(*B, 1)``.
      touch_force: p, how hard a finger has touched so far, newtons, ``(*B, 1)``.
      gentle_n: no goal above this is closed to slower, however hard the object, newtons.
    """
    return (goal_force / (LAST_TOUCH * touch_force).clamp_max(gentle_n)).sqrt().clamp_max(1)


class InductiveBias(Transform):
    """Multiplies the position delta by φ, from contact memory and force error of the same step.

    Only what the environment receives is scaled: the stored action stays the policy's own, so its log-probability
    stays valid. Append it before :class:`ActionScale`: inverses run last-appended first.

    Args:
      one: φ of a finger that waits for the other.
      floor: smallest φ with both fingers in contact.
      gentle_n: goal below which the last finger to touch closes slower on a hard object, newtons; 0: never.
      delta_key: the quantity to scale, ``(*B, motors)``.
      touch_key: what :class:`~forcegrasp.transforms.TouchForce` writes; read only with ``gentle_n``.
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
        touch_key: NestedKey = "touch_force",
    ) -> None:
        super().__init__(in_keys_inv=[delta_key], out_keys_inv=[delta_key])
        self.one, self.floor, self.gentle_n = one, floor, gentle_n
        self.state_keys = (had_contact_key, force_error_key, goal_key)
        self.touch_key = touch_key

    def _inv_call(self, tensordict: TensorDictBase) -> TensorDictBase:
        had_contact, force_error, goal = (tensordict[key] for key in self.state_keys)
        delta = tensordict[self.out_keys_inv[0]]
        closing = gentle_closing(goal, tensordict[self.touch_key], self.gentle_n) if self.gentle_n else None
        phi = contact_bias(had_contact, force_error, goal, self.one, self.floor, delta.shape[-1], closing)
        return tensordict.set(self.in_keys_inv[0], delta * phi)
