"""Runs a policy on a real gripper. Needs numpy, and onnxruntime for exported policies; no torch and no simulator."""

from forcegrasp.deploy.contract import Contract, ForcePIGains, GripperInterface
from forcegrasp.deploy.controller import GraspController
from forcegrasp.deploy.policies import ForcePI, OnnxPolicy, Policy

__all__ = ["Contract", "ForcePI", "ForcePIGains", "GraspController", "GripperInterface", "OnnxPolicy", "Policy"]
