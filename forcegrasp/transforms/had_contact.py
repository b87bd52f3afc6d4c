"""Contact memory, h(t) = c(t) ∨ h(t−1) with c = f > f_θ and h(0) = 0 (paper, eqs. 5-6)."""

from __future__ import annotations

import math

import torch
from tensordict import TensorDictBase
from tensordict.utils import NestedKey
from torchrl.data import Binary, Composite

from forcegrasp.transforms.step_transform import StepTransform


class HadContact(StepTransform):
    """Writes, per finger, 1 once the force has exceeded the threshold in this episode, else 0.

    The memory lives in the tensordict: h(t+1) is written from f(t+1) and h(t), so partial resets and batched envs need
    no bookkeeping.

    Where the force is read from the motor's effort, which moving takes as well, a motor that still moves has no
    contact: with ``stall``, the force counts only in steps in which the motor moved by less than that.

    Args:
      threshold: f_θ, newtons.
      in_key: measured force, newtons, ``(*B, channels)``.
      out_key: the flags, float 0 or 1, ``(*B, channels)``.
      stall: a motor that moves by as much in a step, m or rad, has no contact; infinite by default.
      position_key: measured position, m or rad, ``(*B, channels)``; read only where ``stall`` is given.
    """

    def __init__(
        self,
        threshold: float,
        in_key: NestedKey = "sensed_force",
        out_key: NestedKey = "had_contact",
        stall: float = math.inf,
        position_key: NestedKey = "sensed_position",
    ) -> None:
        super().__init__(in_keys=[in_key], out_keys=[out_key])
        self.threshold, self.stall, self.position_key = threshold, stall, position_key

    def _step(self, tensordict: TensorDictBase, next_tensordict: TensorDictBase) -> TensorDictBase:
        force = next_tensordict[self.in_keys[0]]
        contact = force > self.threshold
        if math.isfinite(self.stall):
            moved = next_tensordict[self.position_key] - tensordict[self.position_key]
            contact = contact & (moved.abs() < self.stall)
        contact = contact.to(force.dtype)
        next_tensordict.set(self.out_keys[0], torch.maximum(contact, tensordict[self.out_keys[0]]))
        return next_tensordict

    def _reset(self, tensordict: TensorDictBase, tensordict_reset: TensorDictBase) -> TensorDictBase:
        return tensordict_reset.set(self.out_keys[0], torch.zeros_like(tensordict_reset[self.in_keys[0]]))

    def transform_observation_spec(self, observation_spec: Composite) -> Composite:
        force = observation_spec[self.in_keys[0]]
        observation_spec[self.out_keys[0]] = Binary(shape=force.shape, dtype=force.dtype, device=force.device)
        return observation_spec
