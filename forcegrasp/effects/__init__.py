"""Physical effects that a simulator may lack, one per file. No torch in here."""

from forcegrasp.effects.base import STAGES, Effect, Parameter
from forcegrasp.effects.registry import catalogue, get_effect

__all__ = ["STAGES", "Effect", "Parameter", "catalogue", "get_effect"]
