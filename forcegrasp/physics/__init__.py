"""The simulated gripper: parameters, sampling, the compiled scene and the batched simulator. No torch in here."""

from forcegrasp.physics.parameters import GraspParameters
from forcegrasp.physics.sampling import FixedGrasps, GraspSampler
from forcegrasp.physics.simulator import GraspSimulator

__all__ = ["FixedGrasps", "GraspParameters", "GraspSampler", "GraspSimulator"]
