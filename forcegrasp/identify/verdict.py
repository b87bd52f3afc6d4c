"""What measurements say of a model."""

from __future__ import annotations

from enum import StrEnum


class Verdict(StrEnum):
    """The answer of a diagnosis, as it is written in JSON."""

    EFFECT = "effect"  #: one effect or several are missing, and which
    ONE_OF = "one_of"  #: an effect is missing, and the data can't tell which of several
    DATA = "data"  #: not the model: something that the set says is wrong, and what
    EXPLAINED = "explained"  #: nothing is missing
    UNKNOWN = "unknown"  #: something is missing that no known effect explains
    NOT_FITTED = "not_fitted"  #: the base model can't be fitted

    @property
    def names_effects(self) -> bool:
        """Whether effects were found, or faults of the set."""
        return self in (Verdict.EFFECT, Verdict.ONE_OF, Verdict.DATA)

    @property
    def lacks_effects(self) -> bool:
        """Whether the model lacks effects, which can be added."""
        return self in (Verdict.EFFECT, Verdict.ONE_OF)
