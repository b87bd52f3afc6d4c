"""What measurements say of a model."""

from __future__ import annotations

from enum import StrEnum


class Verdict(StrEnum):
    """The answer of a diagnosis, as it is written in JSON."""

    EFFECT = "effect"  #: one effect or several are missing, and which
    ONE_OF = "one_of"  #: an effect is missing, and the data can't tell which of several
    EXPLAINED = "explained"  #: nothing is missing
    UNKNOWN = "unknown"  #: something is missing that no known effect explains
    NOT_FITTED = "not_fitted"  #: the base model can't be fitted

    @property
    def names_effects(self) -> bool:
        """Whether effects were found."""
        return self in (Verdict.EFFECT, Verdict.ONE_OF)
