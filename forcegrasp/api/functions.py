"""What ``import forcegrasp as fg`` offers for measurements: each function does what the verb of its name does."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from forcegrasp.cli import measuring
from forcegrasp.cli.results import default_out
from forcegrasp.config import CompareConfig, DiagnoseConfig, FitConfig, validate
from forcegrasp.diagnosis import add_effect, diagnose_set
from forcegrasp.diagnosis.advice import advise
from forcegrasp.errors import ConfigError
from forcegrasp.final_force.analysis import analyse_table
from forcegrasp.identify import comparison, fit_set, loading
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.progress import Progress, silent
from forcegrasp.measure import FinalForceTable, MeasurementSet
from forcegrasp.models.model_file import Model, read_model, write_model
from forcegrasp.replay.time_limit import time_limit
from forcegrasp.reports.results import (
    AddResult,
    CompareResult,
    DiagnoseResult,
    FitResult,
    ModelResult,
    TableResult,
    base_model,
)
from forcegrasp.short_repr import cut

Writable = TypeVar("Writable", FitResult, AddResult)
AnySet = Loaded[MeasurementSet] | Loaded[FinalForceTable] | str | Path | Sequence[str | Path]
AnyModel = Model | ModelResult | str | Path


def load(path: str | Path | Sequence[str | Path]) -> Loaded[MeasurementSet] | Loaded[FinalForceTable]:
    """Reads and checks a measurement set, or several of one gripper and kind, which are joined.

    Args:
      path: a folder, or a list of several, with ``meta.yaml``, ``grasps.csv`` and ``samples.csv`` (or
        ``samples.parquet``); or, for a table of final forces, with ``meta.yaml`` and ``table.csv``.

    Returns:
      The set in ``measured``, its gripper, and in ``warnings`` what looks wrong with it.

    Raises:
      MeasurementError: if the set can't be right: file, row, column and what to do; or if sets can't be joined.
      ConfigError: if its gripper is unknown, or sets are of several.
    """
    return loading.load(path)


def compare(
    data: AnySet, model: AnyModel | None = None, *, seed: int = 0, progress: Progress | None = None
) -> CompareResult | TableResult:
    """Finds out where a model fails on measured grasps, and of several sets which parameters differ between them.

    Args:
      data: what :func:`load` returns, or what it takes.
      model: what :func:`fit`, :func:`diagnose` or :func:`add` returned, or a model's file; a model that was fitted to
        other grasps is tested on all of these. Without one, the base model is fitted to these grasps first.
      seed: of the fit's starts.
      progress: takes lines about what is done, such as ``print``; silent by default.

    Raises:
      MeasurementError: if the set can't be right.
      ConfigError: if the model can't be read, is of another gripper, or is given for a table of final forces.
    """
    validate(CompareConfig(seed=seed))
    loaded, show = _open(data, progress)
    if measuring.is_table(loaded):
        return _analyse(loaded, "compare", model=model)
    given, loaded = (None, loaded) if model is None else _beside(model, loaded, show)
    found, used, notes = comparison.compare(loaded, given, seed, show)
    name = "" if model is None else _name(model)
    return CompareResult(loaded, found, used, name, (*notes, *used.warnings), _file_of(model))


def fit(data: AnySet, *, out: str | Path | None = None, seed: int = 0, progress: Progress | None = None) -> FitResult:
    """Fits a gripper's base model to measured grasps, from several starts.

    Args:
      data: what :func:`load` returns, or what it takes.
      out: the file to write the model to; none by default.
      seed: of the fit's starts.
      progress: takes lines about what is done, such as ``print``; silent by default.

    Raises:
      MeasurementError: if the set can't be right.
      ConfigError: if the set is a table of final forces, or the file can't be written.
    """
    validate(FitConfig(seed=seed))
    path = _file(out)
    loaded, show = _open(data, progress)
    grasps = measuring.refuse_table(loaded, "fit")
    target, _, base = fit_set.fit_model(grasps, seed, show)
    return _written(FitResult(grasps, target, base, base_model(base, target, grasps), path))


def diagnose(
    data: AnySet,
    model: AnyModel | None = None,
    *,
    effects: str | Sequence[str] = (),
    law: bool = False,
    minutes: float = 0.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> DiagnoseResult | TableResult:
    """Finds out which physical effects a model lacks, and which grasp to record next.

    Args:
      data: what :func:`load` returns, or what it takes; six grasps at least.
      model: what to start from, as for :func:`compare`; its parameters are fitted again. The base model by default.
      effects: names of the effects to try; the whole catalogue by default.
      law: look for a formula where no effect explains what is left; takes minutes.
      minutes: end after so many minutes with what was found by then, and ``stopped`` says so; no limit if 0.
      seed: of the fit's starts and of the null distribution.
      progress: takes lines about what is done, such as ``print``; silent by default.

    Raises:
      MeasurementError: if the set can't be right, or has too few grasps to hold any out.
      OutOfTimeError: if the time was over before the base model was fitted.
      ConfigError: if an effect is unknown, the model can't be read or is of another gripper, or one of them is given
        for a table of final forces.
    """
    validate(DiagnoseConfig(minutes=minutes, seed=seed))
    only = (effects,) if isinstance(effects, str) else tuple(effects)
    measuring.check_effects("effects", only)
    loaded, show = _open(data, progress)
    if measuring.is_table(loaded):
        return _analyse(loaded, "diagnosis", model=model, effects=only)
    tried = diagnose_set.chosen_effects(loaded.gripper, only)
    given, loaded = (None, loaded) if model is None else _beside(model, loaded, show)
    names = [effect.name for effect in tried]
    with time_limit(minutes):
        diagnosis, _ = diagnose_set.diagnose_set(loaded, given, names, seed, show, law=law)
    return DiagnoseResult(loaded, diagnosis, advise(diagnosis), tuple(tried), only, _file_of(model))


def add(
    data: AnySet,
    model: AnyModel,
    effect: str,
    *,
    out: str | Path | None = None,
    progress: Progress | None = None,
) -> AddResult:
    """Adds an effect to a model and fits it again, if the error on held-out grasps falls by that.

    Args:
      data: what :func:`load` returns, or what it takes; two grasps at least.
      model: the model to add to, as for :func:`compare`.
      effect: its name, :func:`diagnose` tells which; or the path of a law's file.
      out: the file to write the model to; none by default.
      progress: takes lines about what is done, such as ``print``; silent by default.

    Raises:
      MeasurementError: if the set can't be right.
      ConfigError: if the effect is unknown, in the model already, or does not help; if the model is of another gripper,
        the set is a table of final forces, or the file can't be written.
    """
    measuring.check_effects("effect", [effect])
    path = _file(out)
    loaded, show = _open(data, progress)
    grasps = measuring.refuse_table(loaded, "add")
    measuring.refuse_one_grasp(grasps)
    chosen = measuring.effect_to_add(effect, grasps.gripper)
    given, grasps = _beside(model, grasps, show)
    added = add_effect.add_effect(grasps, given, chosen, show)
    measuring.refuse_useless(added, chosen, "forcegrasp.diagnose")
    return _written(AddResult(grasps, added, chosen, path))


def report(result: ModelResult | TableResult, out: str | Path | None = None) -> Path:
    """Writes a result as the verb does: ``report.html``, which works offline, its figures as JSON, and fitted models.

    Args:
      result: what :func:`compare`, :func:`fit`, :func:`diagnose` or :func:`add` returned.
      out: the folder; a new one below ``runs`` by default.

    Returns:
      The path of ``report.html``.

    Raises:
      ConfigError: if the folder can't be written.
    """
    verb = "diagnose" if result.file == "diagnosis" else result.file
    folder = measuring.check_folder(default_out(verb, str(out or "")))
    result.write_beside(folder)
    return measuring.write_results(folder, result, silent)


def _open(data: AnySet, progress: Progress | None) -> tuple[Loaded[MeasurementSet] | Loaded[FinalForceTable], Progress]:
    """The set, whose warnings are reported, and where to report progress."""
    loaded = data if isinstance(data, Loaded) else load(data)
    show = progress or silent
    for warning in loaded.warnings:
        show(f"warning: {warning}")
    return loaded, show


def _beside(model: AnyModel, loaded: Loaded[MeasurementSet], show: Progress) -> tuple[Model, Loaded[MeasurementSet]]:
    """The model, and the set, with a warning if the model was fitted to another one."""
    given = _model(model)
    warned = loading.warn_of_other_set(loaded, given, _name(model))
    for warning in warned.warnings[len(loaded.warnings) :]:
        show(f"warning: {warning}")
    return given, warned


def _file_of(model: AnyModel | None) -> str:
    """Where a model that was given lies, for commands to type; FILE if it lies nowhere, empty if there is none."""
    path = model if isinstance(model, (str, Path)) else getattr(model, "path", None)
    return "" if model is None else str(path or "FILE")


def _name(model: AnyModel) -> str:
    return str(model) if isinstance(model, (str, Path)) else repr(model)


def _model(model: AnyModel) -> Model:
    if isinstance(model, (str, Path)):
        return read_model(model)
    if isinstance(model, Model):
        return model
    if not isinstance(model, ModelResult):
        raise ConfigError(f"model: {cut(repr(model), 100)} is none; give what fit, diagnose or add returned, or a file")
    return model.model


def _file(out: str | Path | None) -> Path | None:
    return None if out is None else measuring.check_file(Path(out))


def _written(result: Writable) -> Writable:
    """The result, its model written if there is a file to write it to."""
    if result.path is not None:
        write_model(result.model, result.path)
    return result


def _analyse(loaded: Loaded[FinalForceTable], file: str, **unused: object) -> TableResult:
    measuring.refuse_options(loaded, **unused)
    return TableResult(loaded, analyse_table(loaded.measured, loaded.gripper), file)
