"""What a fitted model leaves of recordings, in their own units: of windows, or of whole recordings replayed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fit import fit_exactly
from forcegrasp.identify.fit_set import apply_model
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.loading import Loaded, load
from forcegrasp.identify.predict import predict
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.progress import silent
from forcegrasp.identify.simulators import Simulators
from forcegrasp.measure import MeasurementSet
from forcegrasp.models.model_file import Model, read_model, write_model
from forcegrasp.replay.replay import Replay
from forcegrasp.reports.results import BASE_MODEL, FOUND_MODEL
from tools.real_data.study import Parameter, Study


@dataclass(frozen=True)
class Windows:
    """The windows of a set beside a model's prediction. Shapes: W windows, S samples, C channels."""

    sessions: np.ndarray  #: recording of each window, ``(W,)``
    names: tuple[str, ...]  #: of the windows
    time_s: list[np.ndarray]  #: of each window
    command: list[np.ndarray]
    measured: np.ndarray  #: ``(W, S, C)``
    predicted: np.ndarray  #: ``(W, S, C)``
    counts: np.ndarray  #: which samples are judged, ``(W, S)``
    sigma: np.ndarray  #: noise of each channel, ``(C,)``

    def rms(self, channel: int = 0, sessions: tuple[str, ...] = ()) -> float:
        """Root mean square of what is left of a channel, in its unit."""
        error = (self.measured - self.predicted)[..., channel]
        chosen = self.counts & (np.isin(self.sessions, sessions)[:, None] if sessions else True)
        return float(np.sqrt(np.mean(error[chosen] ** 2)))


def load_servo(data: Path) -> Loaded[MeasurementSet]:
    """A set of recordings, which a table of final forces is not."""
    loaded = load(data)
    if not isinstance(loaded.measured, MeasurementSet):
        raise TypeError(f"{data} holds no recordings")
    return Loaded(loaded.measured, loaded.gripper, loaded.warnings)


def windows(data: Path, model: Path) -> Windows:
    """A model beside a set, as ``forcegrasp compare`` puts it: nothing is fitted."""
    loaded = load_servo(data)
    target, _, found = apply_model(loaded, read_model(model), silent, refit=False)
    grasps = target.grasps
    return Windows(
        np.array([g.session for g in grasps]),
        tuple(g.name for g in grasps),
        [g.time_s for g in grasps],
        [g.command_m for g in grasps],
        target.signals,
        found.fit.predicted,
        target.mask,
        target.sigma,
    )


def whole(data: Path, model: Path) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Each recording replayed from its start to its end: time ``(T,)``, measured and predicted ``(T, C)``."""
    loaded, fitted = load_servo(data), read_model(model)
    found = []
    for one in loaded.measured.grasps:
        effects = [e.setting for e in fitted.effects if e.effect.name != "quantisation"]
        problem = Problem(loaded.gripper, [one], effects)
        vector = problem.start()
        for index, entry in enumerate(problem.entries):
            if entry.effect is None:
                vector[index] = entry.coordinate(fitted.base[entry.parameter].value)
        predicted = predict(Replay(loaded.gripper, [one]), [problem.case(vector)])[0, 0]
        found.append((one.time_s, np.concatenate([one.position_m, one.force_n], axis=1), predicted[: len(one.time_s)]))
    return found


def fit_with(data: Path, base: Path, names: Sequence[str], out: Path) -> Model:
    """Fits a set with these effects, whether they help or not, from a base model's parameters; writes the model."""
    loaded, known = load_servo(data), read_model(base)
    if not out.is_file():
        target, _, start = apply_model(loaded, known, silent, refit=False)
        kinds = [effect_of(name, loaded.gripper) for name in names]
        effects = [EffectSetting(kind, kind.variants[0], np.asarray(kind.trials()[0])) for kind in kinds]
        problem = Problem(loaded.gripper, target.grasps, effects)
        vector = np.r_[start.fit.vector, problem.start()[len(start.fit.vector) :]]
        fit = fit_exactly(target, problem, Simulators(problem, exact=True), vector)
        write_model(model_of(fit, target, loaded, ()), out)
    return read_model(out)


def best_model(diagnosis: Path) -> Path:
    """The model file of a diagnosis with what was found, or the base model's where nothing was."""
    found = diagnosis / FOUND_MODEL
    return found if found.is_file() else diagnosis / BASE_MODEL


def add_base(result: Study, model: Model, published: Mapping[str, float]) -> None:
    """Puts the base parameters of a model beside the published ones."""
    for name, p in model.base.items():
        result.parameters.append(Parameter(name, p.value, p.low, p.high, p.unit, published.get(name)))
