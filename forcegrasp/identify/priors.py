"""What is known of a fit's coordinates beforehand: a prior counts as one more reading of its coordinate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forcegrasp.short_repr import ShortRepr, counted


@dataclass(frozen=True, eq=False, repr=False)
class Priors(ShortRepr):
    """Gaussian priors, independent of one another, of some of a problem's p coordinates."""

    expected: np.ndarray  #: ``(p,)``
    precision: np.ndarray  #: one over the standard deviation; 0 of a coordinate that has no prior, ``(p,)``

    @classmethod
    def none(cls, coordinates: int) -> Priors:
        """No priors, of so many coordinates."""
        return cls(np.zeros(coordinates), np.zeros(coordinates))

    def __len__(self) -> int:
        return int(np.count_nonzero(self.precision))

    def summary(self) -> str:
        return f"{counted(len(self), 'prior')} of {counted(len(self.precision), 'coordinate')}"

    def missed(self, vector: np.ndarray) -> np.ndarray:
        """By how many standard deviations each is missed, ``(priors,)``: a residual."""
        return ((self.expected - vector) * self.precision)[self.precision > 0]

    def beside(self, residual: np.ndarray, vector: np.ndarray) -> np.ndarray:
        """Residuals of N readings as they count, of any shape, with those of the priors below, ``(N + priors,)``."""
        return np.r_[residual.ravel(), self.missed(vector)]

    def cost(self, vector: np.ndarray) -> float:
        """Sum of the squares of that."""
        return float(np.sum(self.missed(vector) ** 2))

    def pull(self, vector: np.ndarray) -> np.ndarray:
        """Half by how much a step along each coordinate would lower that, per unit, ``(p,)``."""
        return self.precision**2 * (self.expected - vector)

    @property
    def information(self) -> np.ndarray:
        """What they add to the normal equations, ``(p, p)``."""
        return np.diag(self.precision**2)

    def below(self, slopes: np.ndarray) -> np.ndarray:
        """Slopes of N readings ``(N, p)`` with those of the priors below, ``(N + priors, p)``."""
        return np.concatenate([slopes, np.diag(self.precision)[self.precision > 0]])


def with_rows(changes: np.ndarray, rows: int) -> np.ndarray:
    """Changes of N readings, ``(N, ...)``, with zeros below up to so many rows: of a prior, which they don't change."""
    return np.pad(changes, [(0, rows - len(changes)), *[(0, 0)] * (changes.ndim - 1)])
