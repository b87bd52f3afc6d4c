"""What shortens a search for missing effects, or ends it, beside what it finds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from forcegrasp.identify.fit import Fit
from forcegrasp.identify.target import Target

#: A question about a fit to a set.
Asked = Callable[[Target, Fit], bool]


def never(_target: Target, _fit: Fit) -> bool:
    """No, of any fit."""
    return False


def always(_target: Target, _fit: Fit) -> bool:
    """Yes, of any fit."""
    return True


@dataclass(frozen=True)
class StopWhen:
    """When a search takes no further trouble; by default at its end, when it finds nothing more."""

    #: What the set gives, moved within its tolerance, may explain what a fit leaves: then effects whose signatures
    #: promise too little are not fitted.
    may_be_given: Asked = never
    #: It explains most of what a fit with effects leaves: then no more are looked for, and what was found is told
    #: without rivals, for the set to be moved first.
    given_first: Asked = never
    #: The same of a fit with one more effect: then it is not begun elsewhere, for no effect leaves what sizes do.
    given_explains: Asked = never
    #: What leaves more than noise is no answer yet: another search goes on from it, which tells its rivals.
    goes_on: bool = False
    #: Cost that the first effect must come down to: one that stays too far from it is not looked for.
    most: float = np.inf


#: By itself alone, when it finds nothing more.
AT_ITS_END = StopWhen()
