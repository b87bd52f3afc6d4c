"""What transforms have in common that look at the step before."""

from __future__ import annotations

from typing import NoReturn

from tensordict import TensorDictBase
from torchrl.envs.transforms import Transform


class StepTransform(Transform):
    """A transform that writes, in ``_step``, what follows from a step and the one before: no good on single frames."""

    def forward(self, tensordict: TensorDictBase) -> NoReturn:
        """Refuses.

        Raises:
          RuntimeError: always.
        """
        name = type(self).__name__
        raise RuntimeError(f"{name} needs the step before: append it to an environment, it can't work on single frames")
