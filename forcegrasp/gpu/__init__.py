"""The same grasps on MuJoCo Warp: thousands at once on a GPU, with every number in torch tensors on the device."""

from forcegrasp.gpu.installation import check_engine

__all__ = ["check_engine"]
