"""Force error, Δf_i = f_goal − f_i (paper, Sec. 4)."""

from __future__ import annotations

from tensordict import TensorDictBase
from tensordict.utils import NestedKey
from torchrl.data import Composite, Unbounded
from torchrl.envs.transforms import Transform


class ForceError(Transform):
    """Writes the difference between goal force and measured force.

    Args:
      goal_key: goal force, newtons, ``(*B, 1)``.
      force_key: measured force, newtons, ``(*B, channels)``.
      out_key: the difference, newtons, ``(*B, channels)``.
    """

    def __init__(
        self,
        goal_key: NestedKey = "goal_force",
        force_key: NestedKey = "sensed_force",
        out_key: NestedKey = "force_error",
    ) -> None:
        super().__init__(in_keys=[goal_key, force_key], out_keys=[out_key])

    def _call(self, next_tensordict: TensorDictBase) -> TensorDictBase:
        goal, force = (next_tensordict[key] for key in self.in_keys)
        return next_tensordict.set(self.out_keys[0], goal - force)

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        return self._call(tensordict)

    def _reset(self, tensordict: TensorDictBase, tensordict_reset: TensorDictBase) -> TensorDictBase:
        return self._call(tensordict_reset)

    def transform_observation_spec(self, observation_spec: Composite) -> Composite:
        force = observation_spec[self.in_keys[1]]
        observation_spec[self.out_keys[0]] = Unbounded(shape=force.shape, dtype=force.dtype, device=force.device)
        return observation_spec
