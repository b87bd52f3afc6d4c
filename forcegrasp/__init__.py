"""forcegrasp: simulate tactile grasping, compare it with measurements, train force controllers that transfer.

Importing it makes ``gymnasium.make("forcegrasp/Grasp-v0")`` work.
"""

import contextlib

__version__ = "0.1.0"

with contextlib.suppress(ImportError):  # a robot's computer runs forcegrasp.deploy with numpy and onnxruntime alone
    import gymnasium

    gymnasium.register("forcegrasp/Grasp-v0", entry_point="forcegrasp.env.gymnasium_view:GraspGymnasiumEnv")
