"""What turns the clean grasp into the paper's learning problem: one class, one file, one equation each."""

from forcegrasp.transforms.action_change_penalty import ActionChangePenalty
from forcegrasp.transforms.action_scale import ActionScale
from forcegrasp.transforms.force_error import ForceError
from forcegrasp.transforms.had_contact import HadContact
from forcegrasp.transforms.inductive_bias import InductiveBias, contact_bias, gentle_closing
from forcegrasp.transforms.last_action import LastAction
from forcegrasp.transforms.observation_noise import ObservationNoise
from forcegrasp.transforms.touch_force import TouchForce

__all__ = [
    "ActionChangePenalty",
    "ActionScale",
    "ForceError",
    "HadContact",
    "InductiveBias",
    "LastAction",
    "ObservationNoise",
    "TouchForce",
    "contact_bias",
    "gentle_closing",
]
