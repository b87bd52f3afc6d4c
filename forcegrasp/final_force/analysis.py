"""What a table of final forces says about the model: n squeezes per object, each by one commanded delta."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import chi2, t

from forcegrasp.final_force.causes import CAUSES, causes_of
from forcegrasp.final_force.sessions import LEAST_REPEATS, Repeats, repeats_of
from forcegrasp.final_force.shapes import (
    BASE,
    FURTHER,
    Candidate,
    Rows,
    Shape,
    ShapeFit,
    bootstrap,
    captured,
    degrees_of_freedom,
    fit_shape,
    rms,
)
from forcegrasp.final_force.slopes import shared_onset, slope_ratio, slopes_differ
from forcegrasp.identify.verdict import Verdict
from forcegrasp.measure.schema import FinalForceTable
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_parts import Training
from forcegrasp.short_repr import ShortRepr, some

#: Rows that an object must have to be fitted.
LEAST_ROWS = 4
#: Probability of a false alarm over all shapes that is accepted.
ALARM = 0.02
#: A shape must lower the leave-one-out error by this share.
LEAST_GAIN = 0.02
_NULLS = 999
# Less than any force sensor resolves.
_LEAST_NOISE_N = 1e-6
_LARGEST_STEP_N = 0.1
_SEED = 20230


@dataclass(frozen=True, repr=False)
class TableAnalysis(ShortRepr):
    """A table of final forces against the base model's static law, and what else would describe it."""

    table: FinalForceTable
    rows: dict[str, Rows]  #: of each object that was fitted
    skipped: dict[str, str]  #: object → why it was not
    verdict: Verdict  #: a table alone never names one effect
    reason: str  #: of the verdict, in a sentence
    effects: tuple[str, ...] = ()  #: what could make the shape that was found
    found: tuple[str, ...] = ()  #: names of the shapes that are equally good, best first; empty if none is needed
    noise_n: float = math.nan
    noise_from: str = ""
    base: Candidate | None = None
    candidates: tuple[Candidate, ...] = ()  #: further shapes, best leave-one-out error first
    intervals: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)  #: object → shape → 95 %, ``(p, 2)``
    position_gain: float | None = None  #: N/m, nominal
    slopes_differ_p: float | None = None  #: probability of slopes that differ this much if all objects had one
    slope_ratio: tuple[float, float, float] | None = None  #: largest ÷ smallest slope with its 95 % interval
    shared: dict[str, float] = field(default_factory=dict)  #: rms error, N, with one onset "travel" or one "force"
    repeats: Repeats = Repeats(0, math.nan)  #: squeezes that were repeated, and what sessions differ by
    training: Training | None = None  #: of the gripper, if its objects' force scale follows the softness κ

    def summary(self) -> str:
        return f"{self.verdict}: {some(self.effects) or self.reason}"

    @property
    def best(self) -> Candidate | None:
        """The shape that describes the table best: the base law unless another one is needed."""
        return next((c for c in self.candidates if self.found and c.shape.name == self.found[0]), self.base)

    def force_scale(self, name: str) -> tuple[float, float, float] | None:
        """f_α of an object under the best shape, with its 95 % interval; None if the gripper gives no gain."""
        gain, best = self.position_gain, self.best
        if gain is None or best is None:
            return None
        low, high = self.intervals[name][best.shape.name][0]
        return float(best.fits[name].slope) / gain, float(low) / gain, float(high) / gain

    def kappa(self, name: str) -> float | None:
        """κ of the paper's coupling whose f_α is nearest to an object's under the base law; None if there is none."""
        if self.training is None or self.position_gain is None or self.base is None:
            return None
        return float(self.training.kappa_of_force_scale(self.base.fits[name].slope / self.position_gain))


def analyse_table(table: FinalForceTable, gripper: Gripper) -> TableAnalysis:
    """Fits the base model's static law, force = kp f_α Δq, and further shapes, and judges whether one is needed.

    Shapes are fitted by least squares per object and judged on all objects together: the improvement must be rare among
    tables that follow the base law (parametric bootstrap, family-wise over the shapes) and show on rows left out.

    Args:
      table: the measurements. Rows with negative deltas are left out: they open the fingers.
      gripper: whose nominal `position_gain`, if it has one, turns slopes into f_α.
    """
    rows, skipped = _usable(table)
    repeats = _repeats(rows)
    rows = {name: r.without(repeats.correction(r.sessions)) for name, r in rows.items()}
    gain = gripper.parameters["position_gain"].nominal if "position_gain" in gripper.parameters else None
    facts = {
        "position_gain": gain,
        "training": gripper.training if gain is not None and "force_scale" in gripper.training.softness else None,
    }
    if not rows:
        why = "; ".join(f"{name}: {reason}" for name, reason in skipped.items())
        return TableAnalysis(table, rows, skipped, Verdict.NOT_FITTED, f"no object can be fitted ({why})", **facts)
    rng = np.random.default_rng(_SEED)
    fits = {shape: {name: fit_shape(shape, r.delta_m, r.force_n) for name, r in rows.items()} for shape in _shapes()}
    noise, noise_from, known = _noise(table, repeats, rows, fits)
    p_family = _family(rows, fits, noise if known else None, rng)
    base = Candidate(BASE, fits[BASE], 1.0, 0.0, 0.0)
    candidates = [_candidate(shape, fits[shape], base, p_family[shape], noise) for shape in FURTHER]
    candidates.sort(key=lambda c: -c.heldout_gain)
    found = _found(candidates, base, noise)
    effects = causes_of(found)
    best = next((c for c in candidates if found and c.shape.name == found[0]), base)
    intervals = {
        name: {
            shape.name: np.quantile(bootstrap(fits[shape][name], r.delta_m, rng), (0.025, 0.975), axis=0).T
            for shape in {BASE: None, best.shape: None}
        }
        for name, r in rows.items()
    }
    verdict, reason = _verdict(found, effects, best, noise, noise_from)
    return TableAnalysis(
        table, rows, skipped, verdict, reason, effects if verdict is Verdict.ONE_OF else (), found, noise, noise_from,
        base, tuple(candidates), intervals, slopes_differ_p=slopes_differ(best, rows),
        slope_ratio=slope_ratio(best, rows, rng),
        shared=shared_onset(rows, fits) if found and "dead_zone" in found else {}, repeats=repeats, **facts,
    )  # fmt: skip


def _shapes() -> tuple[Shape, ...]:
    return (BASE, *FURTHER)


def _usable(table: FinalForceTable) -> tuple[dict[str, Rows], dict[str, str]]:
    rows, skipped = {}, {}
    for name in dict.fromkeys(table.objects):
        chosen = (np.array(table.objects) == name) & (table.delta_q_m >= 0)
        x, y = table.delta_q_m[chosen].astype(float), table.final_force_n[chosen].astype(float)
        if len(x) < LEAST_ROWS:
            skipped[name] = f"{len(x)} rows that close, at least {LEAST_ROWS} are needed"
        elif len(np.unique(x)) < LEAST_ROWS:
            skipped[name] = f"{len(np.unique(x))} different deltas, at least {LEAST_ROWS} are needed"
        elif not _grows(x, y):
            skipped[name] = "its force does not grow with the delta beyond the scatter"
        else:
            sessions = tuple(np.array(table.sessions)[chosen].tolist()) if table.sessions else ()
            rows[name] = Rows(x, y, sessions)
    return rows, skipped


def _repeats(rows: Mapping[str, Rows]) -> Repeats:
    objects = [name for name, r in rows.items() for _ in r.force_n]
    delta, force = (np.concatenate([getattr(r, key) for r in rows.values()] or [[]]) for key in ("delta_m", "force_n"))
    return repeats_of(objects, delta, force, [session for r in rows.values() for session in r.sessions])


def _grows(x: np.ndarray, y: np.ndarray) -> bool:
    """Whether a line with an offset rises, at a one-sided level of 5 %: four rows can't do better."""
    x = x - x.mean()
    slope = float(x @ y / (x @ x))
    error = np.sqrt(np.sum((y - y.mean() - slope * x) ** 2) / (len(x) - 2) / (x @ x))
    return bool(slope > 0 and slope > t.ppf(0.95, len(x) - 2) * error)


def _rounding(rows: Mapping[str, Rows]) -> float:
    """Standard error of readings that were written down in steps of a power of ten, N."""
    force, step = np.concatenate([r.force_n for r in rows.values()]), _LARGEST_STEP_N
    while step > _LEAST_NOISE_N and not np.allclose(force / step, np.round(force / step), rtol=0, atol=1e-6):
        step /= 10
    return max(step / np.sqrt(12), _LEAST_NOISE_N)


def _noise(
    table: FinalForceTable, repeats: Repeats, rows: Mapping[str, Rows], fits: Mapping
) -> tuple[float, str, bool]:
    """Noise of a force, N, in words where it comes from, and whether it is known apart from the fits."""
    left = {shape: sum(float(np.sum(fit.residual**2)) for fit in of.values()) for shape, of in fits.items()}
    best, freedom = min(
        ((squares, degrees_of_freedom(shape, rows)) for shape, squares in left.items()),
        key=lambda pair: pair[0] / pair[1],
    )
    scatter = float(np.sqrt(best / freedom))
    named = [("given with the table", table.force_std_n)]
    if repeats.freedom >= LEAST_REPEATS:
        named.append((f"from {repeats.freedom} repeated squeezes", repeats.noise_n))
    for source, sigma in named:
        if sigma:
            # Where no shape comes down to it, it is no measure of what chance does to a table.
            trusted = best / sigma**2 <= chi2.ppf(0.99, freedom)
            return sigma, source, bool(trusted) and source.startswith("given")
    return max(scatter, _rounding(rows)), "scatter about the best shape: a lower bound, for there are no repeats", False


def _family(rows: Mapping[str, Rows], fits: Mapping, sigma: float | None, rng: np.random.Generator) -> dict:
    """Probability of each shape's improvement, or a better one of any shape, under the base law."""
    n = sum(len(r.force_n) for r in rows.values())
    scatter = np.sqrt(sum(np.sum(fit.residual**2) for fit in fits[BASE].values()) / degrees_of_freedom(BASE, rows))
    least = _rounding(rows)
    spread = sigma or max(float(scatter), least)
    gains = {shape: np.zeros(1 + _NULLS) for shape in FURTHER}
    left = np.zeros(1 + _NULLS)  # squares that the base law leaves
    for name, r in rows.items():
        law = fits[BASE][name].predict(r.delta_m)[:, None]
        y = np.column_stack([r.force_n, law + spread * rng.standard_normal((len(r.force_n), _NULLS))])
        base = captured(BASE.bases(r.delta_m), y)[0]
        left += np.sum(y**2, axis=0) - base
        for shape in FURTHER:
            gains[shape] += np.maximum(captured(shape.bases(r.delta_m), y).max(axis=0) - base, 0.0)
    for shape, gain in gains.items():
        rest = np.maximum(left - gain, n * least**2)  # an exact fit to rounded numbers is no miracle
        gains[shape] = gain / sigma**2 if sigma else n * np.log(np.maximum(left, rest) / rest)
    largest = np.max([gain[1:] for gain in gains.values()], axis=0)
    return {shape: (1 + int(np.sum(largest >= gain[0]))) / (1 + _NULLS) for shape, gain in gains.items()}


def _candidate(shape: Shape, fits: dict[str, ShapeFit], base: Candidate, p_family: float, noise: float) -> Candidate:
    candidate = Candidate(shape, fits, p_family, 0.0, 0.0)
    gains = (base.left_out**2 - candidate.left_out**2) / (2 * noise**2)
    return Candidate(shape, fits, p_family, float(gains.sum()), float(gains.std(ddof=1) * np.sqrt(len(gains))))


def _found(candidates: Sequence[Candidate], base: Candidate, noise: float) -> tuple[str, ...]:
    """Names of the shapes that the table needs and can't tell apart, best first."""
    before = rms(base.left_out)
    good = [c for c in candidates if c.heldout_gain > 0 and rms(c.left_out) < (1 - LEAST_GAIN) * before]
    significant = [c for c in good if c.p_family <= ALARM and before > _LEAST_NOISE_N]
    if not significant:
        return ()
    equal = [significant[0].shape.name]
    for other in good:
        lead = (other.left_out**2 - significant[0].left_out ** 2) / (2 * noise**2)
        if other is not significant[0] and lead.sum() <= max(lead.std(ddof=1) * np.sqrt(len(lead)), 1.0):
            equal.append(other.shape.name)
    if "dead_zone" in equal and "bias" in equal:
        # With no negative readings, a line with a negative offset is the same curve.
        bias = next(c for c in candidates if c.shape.name == "bias")
        equal.remove("bias" if all(fit.values[1] < 0 for fit in bias.fits.values()) else "dead_zone")
    return tuple(equal)


def _verdict(
    found: tuple[str, ...], effects: tuple[str, ...], best: Candidate, noise: float, noise_from: str
) -> tuple[Verdict, str]:
    words = " or a ".join(name.replace("_", " ") for name in found if CAUSES[name] or not effects)
    if effects and "curve" in found:
        words += " (or a bent curve, which no effect of the catalogue makes in such trials)"
    misfit = rms(best.residual) / noise
    if found and not effects:
        return Verdict.UNKNOWN, (
            f"the table follows a {words}, which no effect makes where the delta is added at every step;"
            " where one target is held, the contact's own stiffness bends the curve"
        )
    if not noise_from.startswith("scatter") and misfit > 1.5:
        return Verdict.UNKNOWN, f"the best shape leaves {misfit:.1f} times the noise ({noise_from})"
    if found:
        return Verdict.ONE_OF, f"the table follows a {words}; final forces can't tell which of its effects makes it"
    return Verdict.EXPLAINED, "no shape describes the table better than the base law, beyond what noise would do"
