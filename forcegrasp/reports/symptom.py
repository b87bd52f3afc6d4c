"""What an effect changes in these data: where the error falls, by how much, and what it goes with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forcegrasp.identify.comparison import Cell, Comparison
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.target import Target
from forcegrasp.reports.comparison import amount, covariate_words, words

# A mean that is so large a part of the rms error is worth telling; so is a covariate that explains this share of it.
_OFFSET, _GOES_WITH = 0.4, 0.2
_LEAST_SAMPLES = 40


@dataclass(frozen=True)
class Symptom:
    """Where a model gains most by an effect: a signal, a phase, and in them a grasp."""

    before: Cell
    after: Cell
    index: int  #: of the grasp, or window
    channel: int  #: of the signal
    part: str  #: the grasp, or window, such as "grasp g3 on foam"
    goes_with: str  #: how the error without the effect varies, as a sentence; may be empty

    def sentence(self) -> str:
        """The symptom in words; "it" is the effect."""
        b, a = self.before, self.after
        text = (
            f"without it the model misses {words(b.signal)} by {amount(b.rms, b.unit)} ({b.ratio:.1f} × noise)"
            f" in {words(b.phase)}, most of all in {self.part}; with it by {amount(a.rms, a.unit)} ({a.ratio:.1f} ×)"
        )
        return f"{text}. {self.goes_with}".removesuffix(". ")


def symptom_of(target: Target, before: Fit, after: Fit) -> Symptom:
    """Where an effect lowers the error most, from fits without and with it."""
    falls = before.residual**2 - after.residual**2
    cells = [
        (float(falls[..., k][target.phase == phase].sum()), k, phase)
        for k in range(len(target.axis))
        for phase in range(len(target.phases))
        if (target.phase == phase).any()  # where the error rises everywhere, one without samples would be the best
    ]
    _, k, phase = max(cells)
    inside = target.phase == phase
    index = int(np.argmax(np.sum(np.where(inside, falls[..., k], 0.0), axis=1)))
    name = (target.axis.names[k], target.phases[phase])
    there = [
        next(cell for cell in _as_comparison(target, fit).cells() if (cell.signal, cell.phase) == name)
        for fit in (before, after)
    ]
    part = f"{target.part} {target.grasps[index].label}"
    return Symptom(there[0], there[1], index, k, part, _goes_with(target, before, k, phase))


def _as_comparison(target: Target, fit: Fit) -> Comparison:
    return Comparison(target, fit.predicted, fit.residual, fit.residual, 1.0)


def _goes_with(target: Target, fit: Fit, k: int, phase: int) -> str:
    """Which way a signal is off in a phase, which way in each direction, or what the error goes with else."""
    comparison, unit, sigma = _as_comparison(target, fit), target.axis.units[k], float(target.sigma[k])
    name, residual = words(target.axis.names[k]), fit.residual[..., k]
    inside = residual[target.phase == phase]
    size = float(np.sqrt(np.mean(residual[target.mask] ** 2)))
    covariates = comparison.covariates()
    direction = covariates["direction"]
    way = direction[..., min(k, direction.shape[-1] - 1) if k < target.axis.positions.stop else 0]
    falling, rising = (residual[target.mask & (way == sign)] for sign in (-1, 1))
    if min(len(falling), len(rising)) >= _LEAST_SAMPLES:
        down, up = float(falling.mean()), float(rising.mean())
        if down * up < 0 and min(abs(down), abs(up)) > _OFFSET * size:
            verbs = ("falls", "rises") if target.gripper.is_servo else ("closes", "opens")
            return (
                f"The error flips with the direction: {name} is measured {_off(down * sigma, unit)} the model while it"
                f" {verbs[0]}, {_off(up * sigma, unit)} while it {verbs[1]}"
            )
    mean = float(inside.mean())
    if abs(mean) > _OFFSET * 2 * float(np.sqrt(np.mean(inside**2))):
        return f"There it is measured {_off(mean * sigma, unit)} the model on average"
    kind = target.axis.kind_of(target.axis.names[k])
    covariate, share = next((c, s) for c, of, s in comparison.explanations() if of == kind)
    return f"{share:.0%} of the {kind} error goes with {covariate_words(covariate)}" if share > _GOES_WITH else ""


def _off(mean: float, unit: str) -> str:
    return f"{amount(abs(mean), unit)} {'above' if mean > 0 else 'below'}"
