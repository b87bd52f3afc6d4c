"""Notices a diverged simulation. MuJoCo resets a bad state to finite values and goes on; only counters tell."""

from __future__ import annotations

import ctypes
import functools
from pathlib import Path

import mujoco
import numpy as np

from forcegrasp.errors import PhysicsError
from forcegrasp.physics.parameters import GraspParameters

_BAD = {
    mujoco.mjtWarning.mjWARN_BADQPOS: "positions",
    mujoco.mjtWarning.mjWARN_BADQVEL: "velocities",
    mujoco.mjtWarning.mjWARN_BADQACC: "accelerations",
    mujoco.mjtWarning.mjWARN_BADCTRL: "commands",
}


def silence_log() -> None:
    """Keeps MuJoCo from dropping MUJOCO_LOG.TXT into the working directory: warnings are raised as errors instead."""
    log = mujoco.MjLogConfig.get()
    log.logto_file = log.logto_console = False
    log.set()


def stop_clock() -> None:
    """Keeps MuJoCo from timing the parts of each step, which takes a tenth of it; a clock that somebody set stays.

    ``mujoco.set_mjcb_time(None)`` puts Python's own clock back; only the library itself can go without.
    """
    if mujoco.get_mjcb_time() is not None:
        return
    for clock in _clocks():
        if clock.value is not None:
            clock.value = None


@functools.cache
def _clocks() -> tuple[ctypes.c_void_p, ...]:
    """Where MuJoCo's library keeps its clock; nowhere if the library is not beside the package."""
    libraries = (
        library
        for library in Path(mujoco.__file__).parent.iterdir()
        if library.name.startswith(("libmujoco.", "mujoco.")) and {".so", ".dylib", ".dll"} & set(library.suffixes)
    )
    return tuple(ctypes.c_void_p.in_dll(ctypes.CDLL(str(library)), "mjcb_time") for library in libraries)


def check(warnings: np.ndarray, parameters: GraspParameters, steps: np.ndarray) -> None:
    """Raises if any grasp diverged.

    Args:
      warnings: MuJoCo's warning counters, shape ``(n, number of warnings)``, all 0 in a sound simulation.
      parameters: the n grasps.
      steps: control steps each grasp has done, for the message, ``(n,)``.

    Raises:
      PhysicsError: names the first grasp that diverged, what went wrong, and its parameters.
    """
    if not warnings.any():
        return
    grasp = int(np.flatnonzero(warnings.any(axis=1))[0])
    kind = int(np.flatnonzero(warnings[grasp])[0])
    what = _BAD.get(mujoco.mjtWarning(kind), mujoco.mjtWarning(kind).name)
    raise PhysicsError(
        f"grasp {grasp} diverged at control step {steps[grasp]} (bad {what}): {parameters.describe(grasp)};"
        " narrow the ranges of `grasp` or set physics.tier=reference"
    )
