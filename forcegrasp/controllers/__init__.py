"""Controllers with a policy's interface: they read a tensordict and write ``action`` in [−1, 1]."""

from __future__ import annotations

from collections.abc import Callable

from tensordict.nn import TensorDictModuleBase

from forcegrasp.controllers.force_pi import ForcePI
from forcegrasp.controllers.reference import Constant, InformedFeedForward
from forcegrasp.errors import ConfigError, closest
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import default_gripper

#: Name → constructor, as named in ``policies=[...]``.
CONTROLLERS: dict[str, Callable[[Gripper], TensorDictModuleBase]] = {
    "force_pi": ForcePI,
    "informed": InformedFeedForward,
    "close": lambda gripper: Constant(-1.0),
    "nothing": lambda gripper: Constant(0.0),
}


def make_controller(name: str, gripper: Gripper | None = None) -> TensorDictModuleBase:
    """Returns the controller of that name, for a gripper; the paper's by default.

    Raises:
      ConfigError: if there is none, with the closest names.
    """
    if name not in CONTROLLERS:
        raise ConfigError(f"no controller or run directory named {name!r}{closest(name, CONTROLLERS)}")
    return CONTROLLERS[name](gripper or default_gripper())


__all__ = ["CONTROLLERS", "Constant", "ForcePI", "InformedFeedForward", "make_controller"]
