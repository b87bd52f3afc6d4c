"""What a search has found until now."""

from __future__ import annotations

from dataclasses import dataclass

from forcegrasp.diagnosis.result import Step
from forcegrasp.diagnosis.study import Study
from forcegrasp.identify.fit import Fit

#: A study, the steps that found effects, and a fit with all of them.
Found = tuple[Study, list[Step], Fit]


@dataclass(eq=False)
class SoFar:
    """What a search has found, to be taken whenever it is cut short: each changes all at once."""

    all: Found
    believed: Found | None = None  #: what is, if the rest explains too little in the end
    given_first: bool = False  #: whether what the set gives is to be moved before more effects are looked for

    @property
    def sure(self) -> Found:
        """What is believed whatever else may be found."""
        return self.believed or self.all
