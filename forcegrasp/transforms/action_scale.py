"""Denormalises actions, u = clip(a, −1, 1) · Δq_max (paper, Sec. 4)."""

from __future__ import annotations

from jaxtyping import Float
from tensordict.utils import NestedKey
from torch import Tensor
from torchrl.data import Bounded, Composite
from torchrl.envs.transforms import Transform


class ActionScale(Transform):
    """Turns the policy's action in [−1, 1] into a position delta.

    Args:
      max_delta: Δq_max, m or rad.
      delta_key: what the environment takes, m or rad, ``(*B, motors)``.
      action_key: what the policy gives, ``(*B, motors)``. It is stored as the policy gave it.
    """

    def __init__(
        self, max_delta: float, delta_key: NestedKey = "joint_delta", action_key: NestedKey = "action"
    ) -> None:
        super().__init__(in_keys_inv=[delta_key], out_keys_inv=[action_key])
        self.max_delta = max_delta

    def _inv_apply_transform(self, state: Float[Tensor, "*B motors"]) -> Float[Tensor, "*B motors"]:
        return state.clamp(-1, 1) * self.max_delta

    def transform_input_spec(self, input_spec: Composite) -> Composite:
        input_spec = input_spec.clone()
        actions = input_spec["full_action_spec"]
        delta = actions[self.in_keys_inv[0]]
        del actions[self.in_keys_inv[0]]
        actions[self.out_keys_inv[0]] = Bounded(-1, 1, shape=delta.shape, dtype=delta.dtype, device=delta.device)
        return input_spec
