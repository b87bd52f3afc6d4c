"""A curve that a table of final forces may follow, fitted to each of its objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from forcegrasp.final_force.shapes import Shape, ShapeFit
from forcegrasp.short_repr import ShortRepr


@dataclass(frozen=True, repr=False)
class Rows(ShortRepr):
    """The rows of one object that are fitted."""

    delta_m: np.ndarray  #: ``(n,)``
    force_n: np.ndarray  #: ``(n,)``


@dataclass(frozen=True, repr=False)
class Candidate(ShortRepr):
    """One shape on all objects, each with its own parameters."""

    shape: Shape
    fits: dict[str, ShapeFit]  #: by object
    p_family: float  #: probability that noise about the base law makes the best of all shapes look this good
    heldout_gain: float  #: change of the leave-one-out log-likelihood against the base law
    lead_error: float  #: standard error of that change

    @property
    def left_out(self) -> np.ndarray:
        """Leave-one-out errors of all rows, N."""
        return np.concatenate([fit.left_out for fit in self.fits.values()])

    @property
    def residual(self) -> np.ndarray:
        """Residuals of all rows, N."""
        return np.concatenate([fit.residual for fit in self.fits.values()])


def degrees_of_freedom(shape: Shape, rows: Mapping[str, Rows]) -> int:
    """Rows of all objects that a shape's parameters leave free, 1 at least."""
    return max(1, sum(len(r.force_n) - len(shape.parameters) for r in rows.values()))


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))
