"""Physical effects that a simulator may lack, one per file. No torch in here."""

from forcegrasp.effects.base import STAGES, Contribution, Effect, Nested, Parameter, State
from forcegrasp.effects.registry import catalogue, get_effect

__all__ = ["STAGES", "Contribution", "Effect", "Nested", "Parameter", "State", "catalogue", "get_effect"]
