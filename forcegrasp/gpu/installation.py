"""Is there what MuJoCo Warp needs? Nothing of it is imported before somebody asks for it."""

# pyright: standard, reportMissingImports=false

from __future__ import annotations

import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from forcegrasp.config import PhysicsConfig
from forcegrasp.errors import ConfigError


def check_engine(physics: PhysicsConfig) -> None:
    """Raises ConfigError, with what to do, if the engine can't run here: quickly, before anything is written."""
    if physics.engine != "warp":
        return
    if find_spec("mujoco_warp") is None or find_spec("warp") is None:
        raise ConfigError("physics.engine=warp: MuJoCo Warp is not installed: pip install 'forcegrasp[warp]'")
    if physics.device == "cuda":
        import torch

        if not torch.cuda.is_available():
            raise ConfigError(
                f"physics.device=cuda: torch {torch.__version__} finds no GPU; it takes a CUDA driver and a build of"
                " torch for CUDA; or use physics.device=cpu"
            )


@cache
def start_warp() -> None:
    """Starts Warp without its greetings; says so where its kernels are yet to be compiled."""
    import warp

    level = warp.config.log_level
    warp.config.log_level = warp.LOG_ERROR
    warp.init()
    warp.config.log_level = max(level, warp.LOG_WARNING)
    if not kernels_are_cached():
        print("forcegrasp: Warp compiles its kernels, once per machine: this takes a minute or so", file=sys.stderr)


def kernels_are_cached() -> bool:
    """Whether Warp has compiled kernels on this machine before."""
    import warp

    folder = warp.config.kernel_cache_dir
    return folder is not None and Path(folder).is_dir() and any(Path(folder).iterdir())
