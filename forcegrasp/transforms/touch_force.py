"""How hard the object has been touched so far, p(t) = max(p(t−1), h(t) max f(t)) with p(0) = 0 (own form)."""

from __future__ import annotations

import torch
from tensordict import TensorDictBase
from tensordict.utils import NestedKey
from torchrl.data import Composite, Unbounded

from forcegrasp.transforms.step_transform import StepTransform


class TouchForce(StepTransform):
    """Writes the largest force reading of the episode, of fingers that had contact: 0 until one has touched.

    At the speed of an approach a hard object is touched with more force than a soft one, so that the first finger's
    touch tells what the last one's will be like. The memory lives in the tensordict, as that of
    :class:`~forcegrasp.transforms.HadContact`, which goes before.

    Args:
      force_key: measured force, newtons, ``(*B, channels)``.
      had_contact_key: h, 0 or 1, ``(*B, channels)``.
      out_key: p, newtons, ``(*B, 1)``.
    """

    def __init__(
        self,
        force_key: NestedKey = "sensed_force",
        had_contact_key: NestedKey = "had_contact",
        out_key: NestedKey = "touch_force",
    ) -> None:
        super().__init__(in_keys=[force_key, had_contact_key], out_keys=[out_key])

    def _step(self, tensordict: TensorDictBase, next_tensordict: TensorDictBase) -> TensorDictBase:
        force, had_contact = (next_tensordict[key] for key in self.in_keys)
        felt = torch.where(had_contact > 0.5, force, 0).amax(-1, keepdim=True)
        return next_tensordict.set(self.out_keys[0], torch.maximum(felt, tensordict[self.out_keys[0]]))

    def _reset(self, tensordict: TensorDictBase, tensordict_reset: TensorDictBase) -> TensorDictBase:
        return tensordict_reset.set(self.out_keys[0], torch.zeros_like(tensordict_reset[self.in_keys[0]][..., :1]))

    def transform_observation_spec(self, observation_spec: Composite) -> Composite:
        force = observation_spec[self.in_keys[0]]
        shape = torch.Size([*force.shape[:-1], 1])
        observation_spec[self.out_keys[0]] = Unbounded(shape=shape, dtype=force.dtype, device=force.device)
        return observation_spec
