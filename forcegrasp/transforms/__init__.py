"""What turns the clean grasp into the paper's learning problem: one class, one file, one equation each."""

from forcegrasp.transforms.action_change_penalty import ActionChangePenalty
from forcegrasp.transforms.action_scale import ActionScale
from forcegrasp.transforms.force_error import ForceError
from forcegrasp.transforms.had_contact import HadContact
from forcegrasp.transforms.inductive_bias import InductiveBias, contact_bias
from forcegrasp.transforms.last_action import LastAction
from forcegrasp.transforms.observation_noise import ObservationNoise

__all__ = [
    "ActionChangePenalty",
    "ActionScale",
    "ForceError",
    "HadContact",
    "InductiveBias",
    "LastAction",
    "ObservationNoise",
    "contact_bias",
]
