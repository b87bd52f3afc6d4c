"""Which parameters sets of one gripper share, and in which they differ: each fitted by itself from the same model."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

from forcegrasp.identify import fit_set
from forcegrasp.identify.base_fit import BaseFit, rms_error
from forcegrasp.identify.intervals import (
    Z95,
    chance_errors,
    hardly_fixed,
    intervals,
    listed,
    numerical_shifts,
    reached_bound,
)
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.noise_floor import numerical_error
from forcegrasp.identify.plateaus import plateaus
from forcegrasp.identify.problem import Entry
from forcegrasp.identify.progress import Progress, silent
from forcegrasp.identify.random_effects import holm, p_alike, shared_value, spread_between
from forcegrasp.measure import MeasurementSet
from forcegrasp.models.model_file import Fitted, Model
from forcegrasp.short_repr import ShortRepr, counted

#: Corrected probability below which a parameter is said to differ; as sure as a diagnosis is of an effect.
ALARM = 0.01
#: Sets that a spread between sets needs.
LEAST_FOR_SPREAD = 3
# Standard error, in coordinates, of what leaves a trace; what leaves none has an error of 0.
_LEAST_ERROR = 1e-12


class Agreement(StrEnum):
    """Whether sets have one value of a parameter, as it is written in JSON."""

    DIFFERS = "differs"  #: by more than chance
    SHARED = "shared"  #: no difference was found
    UNCLEAR = "cannot_tell"  #: a fit says too little of it


@dataclass(frozen=True, repr=False)
class SetFit(ShortRepr):
    """A set that was fitted by itself."""

    name: str
    path: Path
    base: BaseFit
    chance: np.ndarray  #: standard errors of the coordinates by chance, ``(p,)``
    shifts: np.ndarray  #: what the model's numerical errors would move them by, ``(errors, p)``
    error: float  #: rms residual ÷ noise

    @property
    def errors(self) -> np.ndarray:
        """Standard errors of the coordinates, ``(p,)``, as :func:`~forcegrasp.identify.intervals.standard_errors`."""
        return np.sqrt(self.chance**2 + np.sum(self.shifts**2, axis=0))


@dataclass(frozen=True, repr=False)
class Between(ShortRepr):
    """One parameter in the sets that have it, the first of which is what others are held against."""

    name: str
    unit: str
    is_ratio: bool  #: whether differences are factors, and the spread is a share of the value
    values: dict[str, Fitted]  #: set → its value
    differences: dict[str, Fitted]  #: later set → its value less the first one's, or ÷ it
    p: float  #: that values as far apart are chance; NaN where that can't be told
    p_corrected: float  #: for the number of parameters
    mean: Fitted  #: of all sets, see :func:`~forcegrasp.identify.random_effects.shared_value`
    spread: Fitted | None  #: standard deviation between sets; None of two
    reason: str  #: why it can't be told whether it differs; empty if it can

    @property
    def agreement(self) -> Agreement:
        """Whether it differs."""
        if self.reason:
            return Agreement.UNCLEAR
        return Agreement.DIFFERS if self.p_corrected < ALARM else Agreement.SHARED

    @property
    def shared(self) -> Fitted | None:
        """The value of all sets; None if there is none, for two differ, or it can't be told."""
        alike = self.agreement is Agreement.SHARED or (self.spread is not None and not self.reason)
        return self.mean if alike else None


@dataclass(frozen=True, repr=False)
class BetweenSets(ShortRepr):
    """What sets share, and what not."""

    sets: tuple[SetFit, ...]
    parameters: tuple[Between, ...]

    def of(self, agreement: Agreement) -> list[Between]:
        """The parameters of which this is said, the surest first."""
        return sorted((p for p in self.parameters if p.agreement is agreement), key=lambda one: one.p)

    def summary(self) -> str:
        differ = len(self.of(Agreement.DIFFERS))
        return f"{counted(len(self.sets), 'set')}: {differ} of {counted(len(self.parameters), 'parameter')} differ"


def compare_sets(parts: Sequence[Loaded[MeasurementSet]], model: Model, progress: Progress) -> BetweenSets:
    """Fits each set by itself, from one model, and compares what several of them have.

    Args:
      parts: two at least, of one gripper; no two have a grasp of the same name.
      model: where each fit starts, with its effects.
      progress: takes a line for each set.
    """
    fits = tuple(_fit(part, model, progress) for part in parts)
    entries = [{e.name: (k, e) for k, e in enumerate(one.base.fit.problem.entries)} for one in fits]
    found = []
    for name in dict.fromkeys(name for own in entries for name in own):
        having = [(one, *own[name]) for one, own in zip(fits, entries, strict=True) if name in own]
        if len(having) > 1:
            found.append(_between(having))
    corrected = iter(holm([one.p for one in found if not one.reason]).tolist())
    return BetweenSets(
        fits, tuple(one if one.reason else dataclasses.replace(one, p_corrected=next(corrected)) for one in found)
    )


def _fit(part: Loaded[MeasurementSet], model: Model, progress: Progress) -> SetFit:
    target, _, base = fit_set.apply_model(part, model, silent, refit=True)
    shifts = numerical_shifts(base.fit, numerical_error(base.fit, target))
    chance = np.maximum(chance_errors(base.fit), plateaus(base.fit, target) / Z95)
    one = SetFit(part.measured.name, part.measured.path, base, chance, shifts, rms_error(base.fit, target))
    progress(f"{one.name} by itself: {one.error:.2f} × noise")
    return one


def _between(having: Sequence[tuple[SetFit, int, Entry]]) -> Between:
    """One parameter: its sets, its place among the coordinates of each, and its entry there."""
    entry, reason = having[0][2], _doubt(having)
    x = np.array([one.base.fit.vector[place] for one, place, _ in having])
    shifts = np.array([one.shifts[:, place] for one, place, _ in having])
    # what the simulation shifts alike in all sets makes no difference between them
    apart = np.sqrt([one.chance[place] ** 2 + np.var(shifts, axis=0, ddof=1).sum() for one, place, _ in having])
    apart = np.maximum(apart, _LEAST_ERROR)
    common = float(np.linalg.norm(np.mean(shifts, axis=0)))
    spread = spread_between(x, apart) if len(x) >= LEAST_FOR_SPREAD and not reason else None
    mean = shared_value(x, apart, spread[0] if spread else None, common)
    size, unit = (1.0, "") if entry.logarithmic else (entry.scale, entry.unit)

    def difference(k: int) -> Fitted:
        half = Z95 * float(np.hypot(apart[0], apart[k]))
        value, low, high = (float(x[k] - x[0] + side) for side in (0.0, -half, half))
        return _fitted((value, low, high), np.exp if entry.logarithmic else lambda c: size * c, unit)

    return Between(
        entry.name, entry.unit, entry.logarithmic,
        {one.name: _fitted(intervals(one.base.fit, one.errors)[place], float, entry.unit) for one, place, _ in having},
        {having[k][0].name: difference(k) for k in range(1, len(x))},
        float("nan") if reason else p_alike(x, apart), float("nan"),
        _fitted(mean, entry.value, entry.unit), spread and _fitted(spread, lambda c: size * c, unit), reason,
    )  # fmt: skip


def _fitted(numbers: tuple[float, float, float], shown: Callable[[float], float], unit: str) -> Fitted:
    value, low, high = (float(shown(number)) for number in numbers)
    return Fitted(value, low, high, unit)


def _doubt(having: Sequence[tuple[SetFit, int, Entry]]) -> str:
    """Why a parameter's fits say too little to compare them; empty if they don't."""
    astray = [one.name for one, *_ in having if not one.base.converged]
    if astray:
        return f"the fit of {listed(astray)} did not converge"
    bound = [
        one.name
        for one, place, e in having
        if reached_bound(float(one.base.fit.values[place]), e.low, e.high, e.logarithmic, e.null) is not None
    ]
    if bound:
        return f"it ended at its bound in {listed(bound)}"
    loose = [
        one.name
        for one, place, _ in having
        if hardly_fixed(one.base.fit, one.errors)[place] or one.chance[place] < _LEAST_ERROR
    ]
    return f"{listed(loose)} hardly {'fixes' if len(loose) == 1 else 'fix'} it" if loose else ""
