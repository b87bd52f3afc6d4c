"""forcegrasp: simulate tactile grasping, compare it with measurements, train force controllers that transfer.

Importing it makes ``gymnasium.make("forcegrasp/Grasp-v0")`` work, and loads none of what the functions need: that comes
with their first use.
"""

import contextlib
import importlib
from typing import TYPE_CHECKING

from forcegrasp.errors import ForcegraspError

if TYPE_CHECKING:
    from forcegrasp.api import add, compare, diagnose, fit, load, report
    from forcegrasp.env import build_env

__version__ = "0.1.0"
__all__ = ["ForcegraspError", "add", "build_env", "compare", "diagnose", "fit", "load", "report"]

_HOMES = dict.fromkeys(__all__, "forcegrasp.api") | {"build_env": "forcegrasp.env"}

with contextlib.suppress(ImportError):  # a robot's computer runs forcegrasp.deploy with numpy and onnxruntime alone
    import gymnasium

    gymnasium.register("forcegrasp/Grasp-v0", entry_point="forcegrasp.env.gymnasium_view:GraspGymnasiumEnv")

if not TYPE_CHECKING:

    def __getattr__(name: str):
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(importlib.import_module(_HOMES[name]), name)

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})
