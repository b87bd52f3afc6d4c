"""The hand-written grasp controller of Lach et al. (2022), with the gains of the authors' Python form."""

from __future__ import annotations

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torchrl.data import Unbounded
from torchrl.envs.transforms import TensorDictPrimer

from forcegrasp.physics.model import CONTROL_PERIOD_S


class ForcePI(TensorDictModuleBase):
    """Closes, waits for both fingers to touch, then controls force with a PI law. Same interface as a policy.

    A finger that has not touched closes at full speed; one that has waits for the other; once both have, the force
    errors divided by the assumed stiffness k enter a PI law and both fingers get half of its position delta:
    Δq = −½ Σ_i (K_p e_i + K_i I_i), e_i = Δf_i / k, where the one integral I runs on over both fingers' errors.

    The integral lives in the tensordict (``force_integral``, metre seconds, ``(*B, 1)``); an environment carries it
    once :meth:`make_tensordict_primer` is appended to it.

    Args:
      max_delta_m: Δq_max that the environment scales actions by, metres.
      stiffness: k, newtons per metre.
      kp, ki: K_p (1) and K_i (1/s).
      closing_m: position delta while closing, metres per step: 0.02 m/s · 40 ms · 5 (authors' code).
    """

    def __init__(
        self,
        max_delta_m: float = 0.003,
        stiffness: float = 160.0,
        kp: float = 0.18,
        ki: float = 1.13,
        closing_m: float = 0.004,
    ) -> None:
        super().__init__()
        self.in_keys = ["had_contact", "force_error", "force_integral"]
        # tensordict's own annotation knows no nested keys
        self.out_keys = ["action", ("next", "force_integral")]  # pyright: ignore[reportAttributeAccessIssue]
        self.max_delta_m, self.stiffness, self.kp, self.ki, self.closing_m = max_delta_m, stiffness, kp, ki, closing_m

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        touched, force_error, integral = (tensordict.get(key) for key in self.in_keys)
        both = touched.bool().all(-1, keepdim=True)
        error = force_error / self.stiffness
        # The authors add the left error to the one integral, use it, then add the right one and use that.
        running = integral + (error * CONTROL_PERIOD_S).cumsum(-1)
        delta = -0.5 * (self.kp * error + self.ki * running).sum(-1, keepdim=True)
        waiting = -self.closing_m * (1 - touched)
        action = torch.where(both, delta, waiting) / self.max_delta_m
        tensordict.set("action", action.clamp(-1, 1))
        return tensordict.set(("next", "force_integral"), torch.where(both, running[..., -1:], integral))

    def make_tensordict_primer(self) -> TensorDictPrimer:
        """The transform that starts the integral at 0 and carries it from step to step."""
        return TensorDictPrimer(force_integral=Unbounded(shape=torch.Size([1]), dtype=torch.float32), expand_specs=True)
