"""Where a model fails: its error per signal and phase, against the floor that sensor noise sets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forcegrasp.identify import fit_set
from forcegrasp.identify.between_sets import BetweenSets, compare_sets
from forcegrasp.identify.cross_validation import heldout_residual, make_folds, rms, rms_of_grasps
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.noise_floor import at_floor, beyond_fit, numerical_error, numerical_floor
from forcegrasp.identify.phases import contacts
from forcegrasp.identify.progress import Progress
from forcegrasp.identify.target import Target
from forcegrasp.measure import MeasurementSet
from forcegrasp.models.model_file import Model
from forcegrasp.short_repr import ShortRepr

#: What a residual is held against, in reports and where nothing explains it.
COVARIATES = ("time_since_contact_s", "velocity_m_s", "direction", "force_n", "command_m", "position_m", "time_s")
_BINS = 12
# A reading went wrong that is so many σ off while those before and after it are within so many, or this share of it: no
# motion is so short.
_WRONG, _FIT, _NEXT_TO_IT = 20.0, 5.0, 0.1
# And that is beyond both of these by this share of what it is off, where none is foretold that is.
_ALONE = 0.5


@dataclass(frozen=True)
class Cell:
    """The error of one signal in one phase."""

    signal: str
    phase: str
    samples: int
    rms: float  #: in the signal's unit
    ratio: float  #: rms ÷ sensor noise
    bias: float  #: mean of measured − predicted, in the signal's unit
    unit: str


@dataclass(frozen=True, repr=False)
class Comparison(ShortRepr):
    """A model against a measurement set."""

    target: Target
    predicted: np.ndarray  #: ``(G, S, C)``
    residual: np.ndarray  #: (measured − predicted) ÷ noise, ``(G, S, C)``
    heldout: np.ndarray  #: the same for grasps held out of the fit; NaN where there are none
    floor: float  #: error ÷ noise that a perfect model would leave
    between: BetweenSets | None = None  #: of several sets, which parameters differ from one to the next
    #: rms ÷ noise by which the model moves with half its physics step, and with MuJoCo's other collision code
    numerical: tuple[float, float] = (0.0, 0.0)

    def summary(self) -> str:
        return f"error {self.floor_ratio():.2f} × noise, a perfect model {self.floor:.2f}"

    def cells(self) -> list[Cell]:
        """One cell for each signal and phase that occurs."""
        found = []
        for k, (signal, unit) in enumerate(zip(self.target.axis.names, self.target.axis.units, strict=True)):
            for index, phase in enumerate(self.target.phases):
                inside = self.residual[..., k][self.target.phase == index]
                if len(inside):
                    ratio, sigma = float(np.sqrt(np.mean(inside**2))), self.target.sigma[k]
                    bias = float(inside.mean() * sigma)
                    found.append(Cell(signal, phase, len(inside), ratio * sigma, ratio, bias, unit))
        return found

    def without_worst(self) -> tuple[str, float]:
        """The grasp with the largest error, and what :meth:`floor_ratio` is without it; NaN if there is no other."""
        held = self.heldout if np.isfinite(self.heldout).any() else self.residual
        worst = int(np.nanargmax(rms_of_grasps(held, self.target)))
        others = np.arange(len(held)) != worst
        return self.target.grasps[worst].label, rms(held, self.target, others[:, None, None])

    def wrong_readings(self) -> np.ndarray:
        """Grasp, sample and signal of single readings that are far off while those beside them fit, ``(n, 3)``.

        They leap from those beside them, where what is foretold does not: a step or a blow that comes a sample early or
        late is no wrong reading. Those that are furthest off come first.
        """
        size = np.where(self.target.mask[..., None], np.abs(np.nan_to_num(self.residual)), 0.0)
        around = np.pad(size, ((0, 0), (1, 1), (0, 0)))
        beside = np.maximum(around[:, :-2], around[:, 2:])
        foretold = self.predicted / self.target.sigma
        leaps = (_leaps(foretold + self.residual) > _ALONE * size) & (_leaps(foretold) < _NEXT_TO_IT * size)
        found = np.argwhere((size > _WRONG) & (beside < np.maximum(_FIT, _NEXT_TO_IT * size)) & leaps)
        return found[np.argsort(-size[tuple(found.T)], kind="stable")]

    def by_grasp(self) -> np.ndarray:
        """rms residual ÷ noise of each grasp, ``(G,)``."""
        return rms_of_grasps(self.residual, self.target)

    def by_grasp_and_phase(self) -> tuple[np.ndarray, list[str]]:
        """rms residual ÷ noise, ``(rows, phases)``, and the names of the rows: grasps, or a servo's recordings.

        NaN where a row has no such phase.
        """
        rows = self.target.recordings or {g.label: np.array([i]) for i, g in enumerate(self.target.grasps)}
        grid = np.full((len(rows), len(self.target.phases)), np.nan)
        for row, indices in enumerate(rows.values()):
            for index in range(len(self.target.phases)):
                inside = self.residual[indices][self.target.phase[indices] == index]
                if inside.size:
                    grid[row, index] = np.sqrt(np.mean(inside**2))
        return grid, list(rows)

    def by_recording(self) -> dict[str, dict[str, float]]:
        """Error ÷ noise of each of a servo's recordings, by signal: held out of the fit, if it could be."""
        found: dict[str, dict[str, float]] = {}
        for name, indices in self.target.recordings.items():
            held = self.heldout[indices]
            residual = np.where(np.isfinite(held), held, self.residual[indices])[self.target.mask[indices]]
            rms_of = np.sqrt(np.mean(residual**2, axis=0)) if len(residual) else np.full(residual.shape[-1], np.nan)
            found[name] = dict(zip(self.target.axis.names, rms_of.tolist(), strict=True))
        return found

    def floor_ratio(self) -> float:
        """Held-out rms residual ÷ sensor noise; of the grasps themselves where none were held out."""
        value = rms(self.heldout, self.target)
        return value if np.isfinite(value) else rms(self.residual, self.target)

    def covariates(self) -> dict[str, np.ndarray]:
        """What the residual may depend on, see :data:`COVARIATES`; NaN where a sample has none.

        Each is ``(G, S, motors)`` or, of what goes with a force, ``(G, S, channels)``; none is empty.
        Positions and forces are the predicted ones: the noise of the measured ones is in the residual, too.
        """
        target = self.target
        inside = target.mask[..., None]
        position = np.where(inside, self.predicted[..., target.axis.positions], np.nan)
        force = np.where(inside, self.predicted[..., target.axis.forces], np.nan)
        motors = {
            name: np.full(position.shape, np.nan) for name in ("velocity_m_s", "direction", "command_m", "time_s")
        }
        since = np.full((*target.mask.shape, force.shape[-1] or position.shape[-1]), np.nan)
        for index, grasp in enumerate(target.grasps):
            n, time = len(grasp.time_s), grasp.time_s - grasp.time_s[0]
            velocity = np.gradient(grasp.position_m, time, axis=0) if n > 1 else np.zeros(grasp.position_m.shape)
            slow = 4 * target.sigma[0] / max(np.median(np.diff(time)), 1e-9) if n > 1 else 0.0
            touched = np.maximum.accumulate(contacts(grasp, target.sigma, target.gripper))
            first = time[np.argmax(touched, axis=0)]
            since[index, :n] = np.where(touched, time[:, None] - first, np.nan)
            motors["velocity_m_s"][index, :n] = velocity
            motors["direction"][index, :n] = np.where(np.abs(velocity) < slow, 0.0, np.sign(velocity))
            motors["command_m"][index, :n] = grasp.command_m
            motors["time_s"][index, :n] = time[:, None]
        found = motors | {"time_since_contact_s": since, "position_m": position, "force_n": force}
        return {name: found[name] for name in COVARIATES if found[name].size}

    def explanations(self) -> list[tuple[str, str, float]]:
        """Covariate, signal kind and the share of the residual's variance that its bins explain, largest first."""
        shares = []
        for name, values in self.covariates().items():
            for kind, part in self.target.axis.kinds.items():
                residual = self.residual[..., part]
                share = _binned_share(of_width(values, residual.shape[-1]), residual, self.target.mask)
                shares.append((name, kind, share))
        return sorted(shares, key=lambda s: -s[2])


def compare(
    loaded: Loaded[MeasurementSet], model: Model | None, seed: int, progress: Progress
) -> tuple[Comparison, Model, list[str]]:
    """Where a model fails; without one, where the base model fails after fitting it."""
    if model is None:
        target, _, base = fit_set.fit_model(loaded, seed, progress)
    else:
        target, _, base = fit_set.apply_model(loaded, model, progress, refit=False)
    fit, same = base.fit, model is None or model.data.get("fingerprint") == loaded.measured.fingerprint
    # a model that has not seen this set is tested on all of it
    held = heldout_residual(fit, target, make_folds(target.grasps)) if same else fit.residual
    numerical = numerical_error(fit, target)
    beyond = beyond_fit(fit, numerical)
    floor = numerical_floor(beyond, target)
    used = model or model_of(fit, target, loaded, numerical)
    between = compare_sets(loaded.parts, used, progress) if loaded.parts else None
    half, other = (rms(one, target) for one in beyond[:2])
    found = Comparison(target, fit.predicted, fit.residual, held, floor, between, (half, other))
    return found, used, [] if model is not None or base.converged else [_not_fitted(found, base.reason)]


def _not_fitted(comparison: Comparison, reason: str) -> str:
    """What a base fit that came to no end means for what was compared."""
    if at_floor(comparison.floor_ratio(), comparison.floor):
        return (
            f"the fit came to no clear end ({reason}), though it leaves no more than that: parameters may be further"
            " off than their intervals say; to see by how much, try another seed="
        )
    return f"the base model is not fitted: {reason}; what it lacks may be the cause, which diagnose looks for"


def of_width(values: np.ndarray, width: int) -> np.ndarray:
    """A covariate, ``(G, S, motors or channels)``, for so many signals: where they don't pair off, the mean for all."""
    if values.shape[-1] == width:
        return values
    return np.repeat(values.mean(axis=-1, keepdims=True), width, axis=-1)


def _binned_share(values: np.ndarray, residual: np.ndarray, mask: np.ndarray) -> float:
    """Share of the residual's mean square that the means of equally filled bins explain."""
    chosen = mask[..., None] & np.isfinite(values)
    x, y = values[chosen], residual[chosen]
    total = np.sum(residual[np.broadcast_to(mask[..., None], residual.shape)] ** 2)
    if len(x) < 5 * _BINS or total == 0:
        return 0.0
    edges = np.unique(np.quantile(x, np.linspace(0, 1, _BINS + 1)))
    bins = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, max(0, len(edges) - 2))
    sums, counts = np.bincount(bins, weights=y), np.bincount(bins)
    return float(np.sum(sums[counts > 0] ** 2 / counts[counts > 0]) / total)


def _leaps(values: np.ndarray) -> np.ndarray:
    """By how much each sample is beyond both that before it and that after it, ``(G, S, C)``; 0 on the way between."""
    before, after = values[:, [0, *range(values.shape[1] - 1)]], values[:, [*range(1, values.shape[1]), -1]]
    return np.maximum(np.maximum(values - np.maximum(before, after), np.minimum(before, after) - values), 0.0)
