"""The grasp as a TorchRL environment, its reward, and the transformed environment of the paper."""

from forcegrasp.env.build import build_env, seed_env, with_memory
from forcegrasp.env.grasp_env import GraspEnv

__all__ = ["GraspEnv", "build_env", "seed_env", "with_memory"]
