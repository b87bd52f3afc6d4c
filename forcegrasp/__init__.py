"""forcegrasp: simulate tactile grasping, compare it with measurements, train force controllers that transfer.

Importing it makes ``gymnasium.make("forcegrasp/Grasp-v0")`` work.
"""

import gymnasium

__version__ = "0.1.0"

gymnasium.register("forcegrasp/Grasp-v0", entry_point="forcegrasp.env.gymnasium_view:GraspGymnasiumEnv")
