"""The hand-written grasp controller of Lach et al. (2022), with the gains of the authors' Python form."""

from __future__ import annotations

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torchrl.data import Unbounded
from torchrl.envs.transforms import TensorDictPrimer

from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import default_gripper


class ForcePI(TensorDictModuleBase):
    """Closes, waits for both fingers to touch, then controls force with a PI law. Same interface as a policy.

    A finger that has not touched closes at full speed; one that has waits for the other; once all have, the force
    errors divided by the assumed stiffness k enter a PI law and all motors get the same position delta:
    Δq = −(1/F) Σ_i (K_p e_i + K_i I_i), e_i = Δf_i / k, over F force readings, where the one integral I runs on over
    all of them. Where readings and motors are not one to one, motors close until every reading has shown contact.

    The integral lives in the tensordict (``force_integral``, metre (or radian) seconds, ``(*B, 1)``); an environment
    carries it once :meth:`make_tensordict_primer` is appended to it.

    Args:
      gripper: gives the assumed stiffness k, the closing step, Δq_max and the control period, see
        :class:`~forcegrasp.physics.gripper_parts.Training`.
      max_delta: Δq_max that the environment scales actions by, m or rad; the gripper's own by default.
      stiffness: k instead, N/m or N/rad.
      kp, ki: K_p (1) and K_i (1/s).
      closing_step: position delta while closing instead, m or rad per step.
    """

    def __init__(
        self,
        gripper: Gripper | None = None,
        max_delta: float | None = None,
        stiffness: float | None = None,
        kp: float = 0.18,
        ki: float = 1.13,
        closing_step: float | None = None,
    ) -> None:
        super().__init__()
        gripper = gripper or default_gripper()
        self.in_keys = ["had_contact", "force_error", "force_integral"]
        # tensordict's own annotation lacks nested keys
        self.out_keys = ["action", ("next", "force_integral")]  # pyright: ignore[reportAttributeAccessIssue]
        self.motors, self.period_s = len(gripper.motors), gripper.period_s
        self.max_delta = gripper.max_step if max_delta is None else max_delta
        self.stiffness = gripper.training.assumed_stiffness if stiffness is None else stiffness
        self.closing_step = gripper.training.closing_step if closing_step is None else closing_step
        self.kp, self.ki = kp, ki

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        touched, force_error, integral = (tensordict.get(key) for key in self.in_keys)
        all_touched = touched.bool().all(-1, keepdim=True)
        error = force_error / self.stiffness
        # The authors add the left error to the one integral, use it, then add the right one and use that.
        running = integral + (error * self.period_s).cumsum(-1)
        delta = -1 / error.shape[-1] * (self.kp * error + self.ki * running).sum(-1, keepdim=True)
        waiting = -self.closing_step * (1 - (touched if touched.shape[-1] == self.motors else all_touched.float()))
        action = torch.where(all_touched, delta, waiting) / self.max_delta
        tensordict.set("action", action.clamp(-1, 1).expand(*action.shape[:-1], self.motors))
        return tensordict.set(("next", "force_integral"), torch.where(all_touched, running[..., -1:], integral))

    def make_tensordict_primer(self) -> TensorDictPrimer:
        """The transform that starts the integral at 0 and carries it from step to step."""
        return TensorDictPrimer(force_integral=Unbounded(shape=torch.Size([1]), dtype=torch.float32), expand_specs=True)
