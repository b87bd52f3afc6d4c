"""What a set gives has a tolerance: what it changes of the signals, and how far it may lead a fit."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.identify.fit import Fit
from forcegrasp.identify.predict import predict
from forcegrasp.identify.priors import with_rows
from forcegrasp.identify.simulators import cheap_tier
from forcegrasp.identify.target import Target
from forcegrasp.measure.schema import MeasurementSet
from forcegrasp.physics.gripper import FORCE_SKEW, SKEW
from forcegrasp.replay.replay import Replay

#: What is given of a clock's rate; of objects; and of when readings are taken.
PERIOD, OF_OBJECTS, OF_READING = "period_share", ("radius_m", "offset_m"), (SKEW, FORCE_SKEW)


@dataclass(frozen=True, eq=False)
class Given:
    """One number that a set gives."""

    kind: str  #: base parameter that it is, or :data:`PERIOD`
    owner: str  #: object or grasp that it is of; "" of the set
    std: float
    members: np.ndarray  #: which grasps it concerns, ``(G,)``

    @property
    def group(self) -> str:
        """What it is of: "object" or "timing"."""
        return "object" if self.kind in OF_OBJECTS else "timing"

    def words(self, move: float) -> str:
        """How it moved."""
        if self.kind == PERIOD:
            return f"the clock's period by {100 * move:+.2g} %"
        names = {SKEW: "time of reading", FORCE_SKEW: "time of reading forces"}
        unit = "ms" if self.kind in names else "mm"
        return f"{names.get(self.kind, f'radius of {self.owner}')} by {1e3 * move:+.2g} {unit}"


def givens_of(measured: MeasurementSet, target: Target) -> tuple[Given, ...]:
    """All that a set gives and has a tolerance."""
    grasps = target.grasps
    objects = dict.fromkeys(g.object for g in grasps if g.radius_m is not None and not g.fitted_m[0])
    placed = [g.name for g in grasps if g.offset_m is not None and not g.fitted_m[1]]
    timing = {PERIOD: measured.period_std_share, SKEW: measured.delay_std_s}
    timing |= {FORCE_SKEW: measured.delay_std_s} if "force" in target.axis.kinds else {}

    def numbers(kind: str, std: float, owners: Sequence[str], of: Sequence[str]) -> list[Given]:
        return [Given(kind, owner, std, np.array([name == owner for name in of])) for owner in owners]

    return (
        *numbers("radius_m", measured.radius_std_m, list(objects), [g.object for g in grasps]),
        *numbers("offset_m", measured.offset_std_m, placed, [g.name for g in grasps]),
        *(Given(kind, "", std, np.ones(len(grasps), bool)) for kind, std in timing.items()),
    )


def given_slopes(target: Target, fit: Fit, numbers: Sequence[Given]) -> np.ndarray:
    """What a standard deviation of each number changes of the signals ÷ noise, ``(N, numbers)``."""
    gripper, grasps, case = fit.problem.gripper, fit.problem.grasps, fit.problem.case(fit.vector)
    tier = cheap_tier(gripper)
    stds = {number.kind: number.std for number in numbers}
    together = {SKEW: (SKEW, FORCE_SKEW)}  # forces are read with the positions, or by so much later
    # what is read after a command shows what it does at once, what is read before does not: slopes either way
    trials = [(kind, way) for kind in stds if kind != PERIOD for way in ((1, -1) if kind in OF_READING else (1,))]
    moved = (case.moved(dict.fromkeys(together.get(kind, (kind,)), way * stds[kind])) for kind, way in trials)
    as_said, *signals = predict(Replay(gripper, grasps, tier), [case, *moved])
    if PERIOD in stds:
        slower = [dataclasses.replace(g, time_s=g.time_s * (1 + stds[PERIOD])) for g in grasps]
        signals.append(predict(Replay(gripper, slower, tier), [case])[0])
        trials.append((PERIOD, 1))
    columns: dict[str, tuple[float, np.ndarray]] = {}
    for (kind, way), one in zip(trials, signals, strict=True):
        change = target.change(one, as_said)
        asked = float(np.sum(change * fit.residual)) / max(float(np.linalg.norm(change)), 1e-9)
        if kind not in columns or asked > columns[kind][0]:
            columns[kind] = asked, way * change
    return np.column_stack([(columns[n.kind][1] * n.members[:, None, None]).ravel() for n in numbers])


def errors_by_givens(fit: Fit, target: Target, measured: MeasurementSet) -> list[np.ndarray]:
    """What signals may be off by, ÷ noise, as what a set gives is not exact, each ``(G, S, C)``; of a servo none.

    Independent of one another: each by a standard deviation of what is left open by the tolerances and by the readings,
    which parameters can't follow in all.

    Args:
      fit: with all as it is given, or was moved to.
      target: the measurements.
      measured: the set, which says how exact it is.
    """
    servo = fit.problem.gripper.is_servo
    givens = () if servo else tuple(given for given in givens_of(measured, target) if given.std > 0)
    if not givens:
        return []
    slopes = given_slopes(target, fit, givens)
    weight = np.broadcast_to(fit.weight, fit.residual.shape).reshape(-1, 1)
    cross = fit.slopes.T @ with_rows(weight * slopes, len(fit.slopes))
    known = (weight * slopes).T @ (weight * slopes) - cross.T @ fit.covariance() @ cross  # by what no parameter follows
    root = np.linalg.cholesky(np.eye(len(givens)) + (known + known.T) / 2)
    return list(np.linalg.solve(root, slopes.T).reshape(len(givens), *fit.residual.shape))
