"""Is there what MuJoCo Warp needs? Nothing of it is imported before somebody asks for it."""

# pyright: standard, reportMissingImports=false

from __future__ import annotations

import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from forcegrasp.config import PhysicsConfig
from forcegrasp.errors import ConfigError
from forcegrasp.physics.gripper import Gripper

#: Fields that a drawn parameter may write per grasp.
WRITTEN = frozenset({"geom_solimp", "actuator_biasprm"})


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


def check_gripper_for_warp(gripper: Gripper) -> None:
    """Raises ConfigError if the engine does not take a gripper."""
    written = {w.field for name in _drawn(gripper) for w in gripper.parameters[name].writes}
    plain = all(m.closed == 0 and m.open > 0 for m in gripper.motors) and all(f.force_sensor for f in gripper.fingers)
    if not (gripper.is_direct and plain and gripper.shape == "cylinder" and written <= WRITTEN):
        raise ConfigError(
            f"physics.engine=warp: does not take gripper {gripper.name}; it takes two motors that slide a finger each"
            " from 0 up, a force sensor per finger, a cylinder, and drawn parameters that write"
            f" {' or '.join(sorted(WRITTEN))}"
        )


def _drawn(gripper: Gripper) -> list[str]:
    return [*gripper.training.softness, *filter(None, [gripper.training.servo_gain])]


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
