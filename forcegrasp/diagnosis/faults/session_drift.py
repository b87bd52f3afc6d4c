"""Force sensors whose gain or zero changes steadily from the first grasp of a session to its last, as they warm up."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.diagnosis.faults.linear_step import linear_step, one_of_each
from forcegrasp.diagnosis.faults.shifted_rows import left_beyond_noise
from forcegrasp.diagnosis.signatures import Background
from forcegrasp.diagnosis.verdict import LEAST_SHARE
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.target import Target
from forcegrasp.measure.schema import MeasuredGrasp

# Less than this share of what changes most is not worth a word.
_HARDLY = 0.05


@dataclass(frozen=True, eq=False)
class SessionDrift:
    """What changes in the course of the longest session."""

    of: str  #: gain or zero
    change: np.ndarray  #: from the first grasp to the last, ``(channels,)``: a share, or N
    left: float  #: the sum of squares beyond the noise that it leaves, by the linear step

    def words(self, columns: Sequence[str]) -> str:
        """What changes, and by how much, by the names of the force columns; not what hardly does."""
        least = _HARDLY * np.abs(self.change).max()
        told = [
            f"{column} by " + (f"{100 * x:+.2g} %" if self.of == "gain" else f"{x:+.2g} N")
            for column, x in zip(columns, self.change.tolist(), strict=True)
            if abs(x) > least
        ]
        return f"the {self.of} of forces changes steadily from the first grasp of a session to the last: {listed(told)}"

    def taken_out(self, grasp: MeasuredGrasp, order: float) -> MeasuredGrasp:
        """The grasp with forces as they would have been read at first in its session; see `order_in_session`."""
        force = grasp.force_n / (1 + order * self.change) if self.of == "gain" else grasp.force_n - order * self.change
        return dataclasses.replace(grasp, force_n=force)


def order_in_session(grasps: Sequence[MeasuredGrasp]) -> np.ndarray:
    """When each grasp came, ``(G,)``: 0 is the first of a session, and 1 the last of the longest one."""
    before: Counter[str] = Counter()
    place = np.zeros(len(grasps))
    for index, grasp in enumerate(grasps):
        place[index] = before[grasp.session]
        before[grasp.session] += 1
    return place / (max(*before.values(), 2) - 1)


def session_drift(target: Target, fit: Fit) -> SessionDrift | None:
    """What drifts, gain or zero, by a linear step from a fit; None unless that is some of what the fit leaves.

    No effect knows which grasp it acts in: as much is enough as of an effect. But gains or zeros that are as much off
    in all grasps must not do as well.

    Args:
      target: the measurements.
      fit: of the base model.
    """
    order, forces = order_in_session(target.grasps), fit.predicted[..., target.axis.forces]
    background = Background(fit, ())
    left = left_beyond_noise(fit.residual, background, target)
    least, best = (1 - LEAST_SHARE) * max(0.0, left), None
    for of, one_unit in (("gain", forces), ("zero", np.ones_like(forces))):
        always = one_of_each(target, target.axis.forces) * one_unit[..., None, :]
        change, left = linear_step(target, fit, background, order[:, None, None, None] * always)
        if left < min(least, linear_step(target, fit, background, always)[1]):
            least, best = left, SessionDrift(of, change, left)
    return best
