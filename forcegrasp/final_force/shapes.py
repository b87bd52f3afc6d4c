"""Curves that a table of final forces may follow, and their fits to one object's rows."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from forcegrasp.short_repr import ShortRepr

_GRID = 201
# Rows are left out one by one up to this many; more of them in groups, to bound the time.
_FOLDS = 60


@dataclass(frozen=True)
class Shape:
    """A curve of force over commanded delta x: linear in its slope, with at most one more parameter θ.

    ``grid`` gives the θ that are tried for an object's deltas; ``columns`` gives the curve's linear parts,
    ``(m, n, k)`` for ``m`` values of θ and ``n`` deltas.
    """

    name: str
    formula: str
    parameters: tuple[str, ...]  #: slope_n_m, then what else there is
    grid: Callable[[np.ndarray], np.ndarray]
    columns: Callable[[np.ndarray, np.ndarray], np.ndarray]
    steps: bool = False  #: the fit is the same between two deltas, so that there is nothing to refine

    @property
    def has_theta(self) -> bool:
        """Whether there is a parameter in which the curve is not linear."""
        return len(self.parameters) == 2 and self.name != "bias"

    def bases(self, x: np.ndarray) -> np.ndarray:
        """Orthonormal bases of the linear parts for every θ of the grid, ``(m, n, k)``."""
        return _orthonormal(self.columns(x, self.grid(x)))


@dataclass(frozen=True, repr=False)
class ShapeFit(ShortRepr):
    """A shape fitted to the rows of one object."""

    shape: Shape
    values: np.ndarray  #: in the order of the shape's parameters
    residual: np.ndarray  #: measured − fitted, N, ``(n,)``
    left_out: np.ndarray  #: measured − predicted from the other rows, N, ``(n,)``

    @property
    def slope(self) -> float:
        """N/m."""
        return float(self.values[0])

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Force of each delta, N."""
        if self.shape.has_theta:
            return self.shape.columns(x, self.values[1:])[0, :, 0] * self.slope
        return self.shape.columns(x, np.zeros(1))[0] @ self.values


@dataclass(frozen=True, repr=False)
class Rows(ShortRepr):
    """The rows of one object that are fitted."""

    delta_m: np.ndarray  #: ``(n,)``
    force_n: np.ndarray  #: ``(n,)``
    sessions: tuple[str, ...] = ()  #: of each row; empty if the table does not say

    def without(self, shift_n: np.ndarray) -> Rows:
        """The rows with a shift of each session taken out, ``(n,)`` or empty."""
        return dataclasses.replace(self, force_n=self.force_n - shift_n) if len(shift_n) else self


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


def _orthonormal(columns: np.ndarray) -> np.ndarray:
    if columns.shape[-1] > 1:
        return np.linalg.qr(columns)[0]
    return columns / np.maximum(np.linalg.norm(columns, axis=1, keepdims=True), 1e-300)


def _none(x: np.ndarray) -> np.ndarray:
    return np.zeros(1)


def _onsets(x: np.ndarray) -> np.ndarray:
    # Three different deltas must stay beyond the onset, or two rows and a line through them would explain anything.
    return np.linspace(0.0, np.unique(x)[-3], _GRID, endpoint=False)


def _gates(x: np.ndarray) -> np.ndarray:
    distinct = np.unique(x)
    return np.r_[0.0, (distinct[:-3] + distinct[1:-2]) / 2] if len(distinct) > 3 else np.zeros(1)


def _knees(x: np.ndarray) -> np.ndarray:
    distinct = np.unique(x[x > 0])
    return np.r_[np.linspace(distinct[min(1, len(distinct) - 2)], distinct[-2], _GRID), distinct[-1]]


def _powers(x: np.ndarray) -> np.ndarray:
    return np.linspace(0.4, 3.0, 53)


def _power_curve(x: np.ndarray, theta: np.ndarray) -> np.ndarray:
    largest = x.max()
    return (largest * (x / largest) ** theta[:, None])[:, :, None]


BASE = Shape("base", "s Δq", ("slope_n_m",), _none, lambda x, theta: x[None, :, None])
DEAD_ZONE = Shape(
    "dead_zone", "s max(Δq − d, 0)", ("slope_n_m", "onset_m"), _onsets,
    lambda x, theta: np.maximum(x - theta[:, None], 0.0)[:, :, None],
)  # fmt: skip
GATE = Shape(
    "gate", "s Δq beyond d, else 0", ("slope_n_m", "onset_m"), _gates,
    lambda x, theta: np.where(x > theta[:, None], x, 0.0)[:, :, None], steps=True,
)  # fmt: skip
PLATEAU = Shape(
    "plateau", "s min(Δq, k)", ("slope_n_m", "knee_m"), _knees,
    lambda x, theta: np.minimum(x, theta[:, None])[:, :, None],
)  # fmt: skip
CURVE = Shape("curve", "s x̂ (Δq / x̂)^p, x̂ the largest", ("slope_n_m", "power"), _powers, _power_curve)
BIAS = Shape(
    "bias", "s Δq + b", ("slope_n_m", "bias_n"), _none,
    lambda x, theta: np.stack([x, np.ones_like(x)], axis=1)[None],
)  # fmt: skip
#: What a table may show beyond the base model's law.
FURTHER = (DEAD_ZONE, GATE, PLATEAU, CURVE, BIAS)


def fit_shape(shape: Shape, x: np.ndarray, y: np.ndarray) -> ShapeFit:
    """Fits a shape to rows: the best θ of the grid, refined by least squares, and every row left out once."""
    theta, columns = shape.grid(x), shape.columns(x, shape.grid(x))
    values, residual = _best(theta, columns, x, y, shape)
    if shape.has_theta and not shape.steps and len(theta) > 1:
        values, residual = _refine(shape, theta, values, x, y)
    left_out = np.empty_like(y)
    folds = min(len(y), _FOLDS)
    for fold in range(folds):
        out = np.arange(len(y)) % folds == fold
        index, coefficients = _pick(columns[:, ~out], y[~out])
        left_out[out] = y[out] - columns[index, out] @ coefficients
    return ShapeFit(shape, values, residual, left_out)


def _pick(columns: np.ndarray, y: np.ndarray) -> tuple[int, np.ndarray]:
    index = int(np.argmax(captured(_orthonormal(columns), y[:, None])[:, 0]))
    return index, np.linalg.lstsq(columns[index], y, rcond=None)[0]


def _best(theta: np.ndarray, columns: np.ndarray, x: np.ndarray, y: np.ndarray, shape: Shape):
    index, coefficients = _pick(columns, y)
    values = np.r_[coefficients, theta[index]] if shape.has_theta else coefficients
    return values, y - columns[index] @ coefficients


def _refine(shape: Shape, theta: np.ndarray, values: np.ndarray, x: np.ndarray, y: np.ndarray):
    def residual(vector: np.ndarray) -> np.ndarray:
        return vector[0] * shape.columns(x, vector[1:])[0, :, 0] - y

    low, high = theta.min(), theta.max()
    start = np.clip(values, [-np.inf, low], [np.inf, high])
    found = least_squares(
        residual, start, bounds=([-np.inf, low], [np.inf, high]), x_scale=[max(abs(values[0]), 1.0), high - low]
    )
    better = found.cost < 0.5 * np.sum(residual(values) ** 2)
    values = found.x if better else values
    return values, -residual(values)


def captured(bases: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Sum of squares that each basis explains.

    Args:
      bases: orthonormal, ``(m, n, k)``.
      y: columns of forces, ``(n, b)``.

    Returns:
      ``(m, b)``.
    """
    # Not by BLAS: its threads cost ten times these small products where cores are shared.
    return (np.einsum("mnk,nb->mkb", bases, y) ** 2).sum(axis=1)


def bootstrap(fit: ShapeFit, x: np.ndarray, rng: np.random.Generator, count: int = 999) -> np.ndarray:
    """Values of the shape's parameters on resampled tables, ``(count, parameters)``.

    Residuals are drawn with replacement and added to the fit. They are inflated for the freedom that the fit used up,
    without which n = 10 rows give intervals 10 % too narrow.
    """
    shape, n, p = fit.shape, len(x), len(fit.values)
    spread = (fit.residual - fit.residual.mean()) * np.sqrt(n / max(n - p, 1))
    y = fit.predict(x)[:, None] + rng.choice(spread, (n, count))
    theta, columns = shape.grid(x), shape.columns(x, shape.grid(x))
    index = np.argmax(captured(_orthonormal(columns), y), axis=0)
    inverse = np.linalg.pinv(columns)  # (m, k, n)
    coefficients = np.einsum("bkn,nb->bk", inverse[index], y)
    return np.column_stack([coefficients, theta[index]]) if shape.has_theta else coefficients


def degrees_of_freedom(shape: Shape, rows: Mapping[str, Rows]) -> int:
    """Rows of all objects that a shape's parameters leave free, 1 at least."""
    return max(1, sum(len(r.force_n) - len(shape.parameters) for r in rows.values()))


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))
