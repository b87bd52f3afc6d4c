"""The simulated gripper: its description, parameters, sampling and the batched simulator. No torch in here."""

from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import default_gripper, load_gripper, shipped_grippers
from forcegrasp.physics.parameters import GraspParameters
from forcegrasp.physics.sampling import FixedGrasps, GraspSampler
from forcegrasp.physics.simulator import GraspSimulator

__all__ = [
    "FixedGrasps",
    "GraspParameters",
    "GraspSampler",
    "GraspSimulator",
    "Gripper",
    "default_gripper",
    "load_gripper",
    "shipped_grippers",
]
