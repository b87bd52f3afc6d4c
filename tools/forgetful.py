"""What the memory of a recurrent policy is worth to it: evaluates a run with its memories zeroed at every step.

python tools/forgetful.py 'policies=[runs/RUN,force_pi]' [OPTION=VALUE ...]
"""

from __future__ import annotations

import sys
from typing import Any

import torch
from torchrl.modules import GRUModule

from forcegrasp.cli.main import main


def forget(module: GRUModule, inputs: tuple[Any, ...]) -> None:
    """Every step is the first of an episode."""
    (state,) = inputs
    state["is_init"] = torch.ones_like(state["is_init"])


def hook_every_memory() -> None:
    init = GRUModule.__init__

    def forgetful(self: GRUModule, *args: Any, **options: Any) -> None:
        init(self, *args, **options)
        self.register_forward_pre_hook(forget)

    GRUModule.__init__ = forgetful


if __name__ == "__main__":
    hook_every_memory()
    sys.exit(main(["evaluate", *sys.argv[1:]]))
