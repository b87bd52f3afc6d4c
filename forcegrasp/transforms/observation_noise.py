"""Sensor noise, o = s + σ ε (paper, Sec. 4), and the rounding of a converter after it."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from tensordict import TensorDictBase
from tensordict.utils import NestedKey
from torchrl.data import Composite, Unbounded
from torchrl.envs.transforms import Transform

from forcegrasp.physics.sensors import with_noise


class ObservationNoise(Transform):
    """Adds Gaussian noise of a fixed standard deviation to each entry, and writes the result beside the truth.

    The transform owns its generator, because seeding an environment does not reach transforms: seed it with
    :meth:`set_seed`, differently in each worker. The generator's state is part of ``state_dict()``.

    Args:
      in_keys: the true quantities, ``(*B, d)``.
      out_keys: where the readings go.
      std: one standard deviation per key, in that key's unit; 0 copies the value.
      seed: seed of the generator.
      device: where the noise is drawn; that of the readings, lest it be copied there.
      step: one step per key that readings are rounded to, after the noise, in that key's unit; 0 rounds nothing.
      per_row: an entry, ``(*B, 2 keys)``: a factor of ``std`` for each key, then for each a step in place of ``step``.
    """

    def __init__(
        self,
        in_keys: Sequence[NestedKey],
        out_keys: Sequence[NestedKey],
        std: Sequence[float | int],
        seed: int = 0,
        device: torch.device | str = "cpu",
        step: Sequence[float] | None = None,
        per_row: NestedKey | None = None,
    ) -> None:
        if not len(in_keys) == len(out_keys) == len(std):
            raise ValueError(f"needs one out_key and one std per in_key; got {in_keys}, {out_keys}, {std}")
        super().__init__(in_keys=in_keys, out_keys=out_keys)
        self.std = [float(s) for s in std]
        self.step = [float(s) for s in step or [0.0] * len(std)]
        self.per_row = per_row
        self.generator = torch.Generator(device)
        self.set_seed(seed)

    def set_seed(self, seed: int) -> None:
        """Restarts the noise."""
        self.generator.manual_seed(seed)

    def _call(self, next_tensordict: TensorDictBase) -> TensorDictBase:
        rows = None if self.per_row is None else next_tensordict[self.per_row].chunk(2, dim=-1)
        for i, (in_key, out_key, std, step) in enumerate(
            zip(self.in_keys, self.out_keys, self.std, self.step, strict=True)
        ):
            value = next_tensordict[in_key]
            device = self.generator.device
            noise = torch.randn(value.shape, generator=self.generator, dtype=value.dtype, device=device)
            if rows is None:
                reading = with_noise(value, std, noise.to(value.device), step)
            else:
                factor, steps = (part[..., i : i + 1] for part in rows)
                reading = with_noise(value, std * factor, noise.to(value.device))
                reading = torch.where(steps > 0, steps * (reading / steps).round(), reading)
            next_tensordict.set(out_key, reading)
        return next_tensordict

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        return self._call(tensordict)

    def _reset(self, tensordict: TensorDictBase, tensordict_reset: TensorDictBase) -> TensorDictBase:
        return self._call(tensordict_reset)

    def transform_observation_spec(self, observation_spec: Composite) -> Composite:
        for in_key, out_key in zip(self.in_keys, self.out_keys, strict=True):
            true = observation_spec[in_key]
            observation_spec[out_key] = Unbounded(shape=true.shape, dtype=true.dtype, device=true.device)
        return observation_spec

    def clone(self):
        other = super().clone()
        other.generator = self.generator.clone_state()
        return other

    def get_extra_state(self) -> torch.Tensor:
        return self.generator.get_state()

    def set_extra_state(self, state: torch.Tensor) -> None:
        self.generator.set_state(state)
