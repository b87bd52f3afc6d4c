"""What compare, fit, diagnose and add find: the answer, figures, arrays, and what a report is made of."""

from __future__ import annotations

import dataclasses
from functools import cached_property
from pathlib import Path
from typing import Any

from forcegrasp.diagnosis.add_effect import Added
from forcegrasp.diagnosis.advice import Advice
from forcegrasp.diagnosis.result import Diagnosis
from forcegrasp.effects import Effect
from forcegrasp.effects.law import write_law
from forcegrasp.final_force.analysis import TableAnalysis
from forcegrasp.identify.base_fit import BaseFit
from forcegrasp.identify.comparison import Comparison
from forcegrasp.identify.cross_validation import rms
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.noise_floor import numerical_error
from forcegrasp.identify.target import Target
from forcegrasp.identify.verdict import Verdict
from forcegrasp.measure import FinalForceTable, MeasurementSet
from forcegrasp.models.model_file import Model, write_model
from forcegrasp.reports import comparison as comparison_report
from forcegrasp.reports import diagnosis as diagnosis_report
from forcegrasp.reports import diagnosis_answer, diagnosis_as_json, next_step
from forcegrasp.reports import final_force as final_force_report
from forcegrasp.reports import fit as fit_report
from forcegrasp.reports.diagnosis_box import answer_box
from forcegrasp.reports.diagnosis_words import why_left_out
from forcegrasp.reports.html import Answer, Command, Section
from forcegrasp.reports.physics_step import warning_of_fit
from forcegrasp.short_repr import ShortRepr, counted, cut, some

#: The base model that compare and diagnose fit where none is given, beside their report.
BASE_MODEL = "base_model.yaml"
#: The model with all effects that a diagnosis found, beside its report.
FOUND_MODEL = "model.yaml"
#: The commands of the grasp that a diagnosis proposes, beside its report.
NEXT_GRASP = "next_grasp.csv"
#: The law that a diagnosis proposes, beside its report.
PROPOSED_LAW = "law.yaml"


class Result(ShortRepr):
    """Base of all results. Errors are in units of the sensor noise: 1 is as good as it gets."""

    data: Any  #: the set, as :func:`forcegrasp.api.load` returns it
    file: str  #: name of its JSON file, without the ending

    @property
    def answer(self) -> str:
        """The result in a sentence or two."""
        raise NotImplementedError

    @property
    def title(self) -> str:
        """Heading of the report."""
        raise NotImplementedError

    def to_dict(self) -> dict[str, Any]:
        """All figures in plain types: what the verb writes as JSON."""
        raise NotImplementedError

    def sections(self) -> list[Section]:
        """The sections of the report: what the answer rests on."""
        raise NotImplementedError

    def commands(self, folder: Path) -> list[Command]:
        """What to type next, likeliest first, once the report was written into a folder."""
        return []

    def box(self, folder: Path) -> Answer | str:
        """The box above the report that is written into a folder: the answer, how sure it is, and what to do next."""
        return self.answer

    def models(self) -> dict[str, Model]:
        """The models that lie beside the report, by the names of their files."""
        return {}

    def write_beside(self, folder: Path) -> None:
        """Writes into a folder what lies beside its report.

        Raises:
          ConfigError: if it can't be written.
        """
        for name, model in self.models().items():
            write_model(model, folder / name)

    @property
    def name(self) -> str:
        """The set's name."""
        return self.data.measured.name


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class CompareResult(Result):
    """Where a model fails."""

    data: Loaded[MeasurementSet]
    comparison: Comparison  #: all arrays, measured, predicted and their difference
    model: Model  #: what was judged
    given: str  #: what that model was given as; empty if it is the base model, fitted to this set
    notes: tuple[str, ...]  #: what to bear in mind
    given_file: str = ""  #: where that model lies, as it stands in commands; empty as above

    file = "compare"

    @property
    def error(self) -> float:
        """rms error on held-out grasps."""
        return self.comparison.floor_ratio()

    @property
    def floor(self) -> float:
        """The error that a perfect model would leave."""
        return self.comparison.floor

    @property
    def answer(self) -> str:
        return comparison_report.answer(self.comparison)

    @property
    def title(self) -> str:
        return f"Where the model fails: {self.name}"

    def to_dict(self) -> dict[str, Any]:
        name = self.given or "base model, fitted to this set"
        return comparison_report.compare_json(self.comparison, self.name, name, list(self.notes))

    def sections(self) -> list[Section]:
        return comparison_report.sections(self.comparison, list(self.notes))

    def commands(self, folder: Path) -> list[Command]:
        known = self.given_file or folder / BASE_MODEL
        return next_step.after_comparison(self.comparison, self.data.measured.path, known)

    def box(self, folder: Path) -> Answer:
        return comparison_report.answer_box(self.comparison, self.notes, self.commands(folder))

    def models(self) -> dict[str, Model]:
        return {} if self.given_file else {BASE_MODEL: dataclasses.replace(self.model, warnings=self.notes)}

    def summary(self) -> str:
        worst = comparison_report.worst_cell(self.comparison.cells())
        return (
            f"{cut(self.name)}: error {self.error:.2f} × noise, a perfect model {self.floor:.2f};"
            f" largest in {worst.phase}, {worst.signal}: {worst.ratio:.1f} × noise"
        )


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class FitResult(Result):
    """A gripper's base model."""

    data: Loaded[MeasurementSet]
    target: Target
    base: BaseFit
    model: Model  #: with 95 % intervals
    path: Path | None  #: where it was written to

    file = "fit"

    @property
    def converged(self) -> bool:
        """Whether the fit converged; ``base.reason`` says why not."""
        return self.base.converged

    @cached_property
    def error(self) -> float:
        """rms error on held-out grasps; NaN where there are too few to hold any out."""
        return rms(fit_report.held_out(self.base.fit, self.target), self.target)

    @property
    def answer(self) -> str:
        return fit_report.fit_answer(self.base, self.target)

    @property
    def title(self) -> str:
        return f"Base model of {self.name}"

    def to_dict(self) -> dict[str, Any]:
        return fit_report.fit_json(self.base, self.target, self.model, self.name, self.path or Path("model.yaml"))

    def sections(self) -> list[Section]:
        return fit_report.fit_sections(self.base, self.target, self.model)

    def commands(self, folder: Path) -> list[Command]:
        return [next_step.after_fit(self.data.measured.path, self.path or folder / "model.yaml")]

    def box(self, folder: Path) -> Answer:
        return fit_report.model_box(self.answer, self.model, self.commands(folder))

    def models(self) -> dict[str, Model]:
        return {"model.yaml": self.model}

    def summary(self) -> str:
        verdict = "converged" if self.converged else f"NOT fitted, {cut(self.base.reason, 100)}"
        parameters = counted(len(self.base.fit.vector), "parameter")
        warnings = counted(len(self.model.warnings), "warning")
        return f"{cut(self.name)}: {verdict}; error {self.error:.2f} × noise, {parameters}, {warnings}"


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class DiagnoseResult(Result):
    """Which physical effects a model lacks."""

    data: Loaded[MeasurementSet]
    diagnosis: Diagnosis  #: all steps of the search, with every candidate
    advice: Advice | None  #: which grasp to record next
    tried: tuple[type[Effect], ...]
    only: tuple[str, ...]  #: the effects that were asked for; empty if all were tried
    given_file: str = ""  #: where the model to start from lies, as it stands in commands; empty if none was given

    file = "diagnosis"

    @property
    def verdict(self) -> Verdict:
        """One of "effect", "one_of", "data", "explained", "unknown" and "not_fitted"."""
        return self.diagnosis.verdict

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects that were found, in that order; with "one_of", those that the data can't tell apart."""
        return self.diagnosis.effects

    @property
    def stopped(self) -> str:
        """Why the search ended before all was tried, in words; empty if it did not."""
        return self.diagnosis.stopped

    @property
    def error_before(self) -> float:
        """rms error on held-out grasps, without any effect."""
        return self.diagnosis.error_before

    @property
    def error_after(self) -> float:
        """The same with the effects that were found."""
        return self.diagnosis.error_after

    @cached_property
    def model(self) -> Model:
        """The fitted model, with the effects that were found; of those that can't be told apart with the first."""
        diagnosis = self.diagnosis
        if not self.verdict.names_effects:
            return self._base_model
        model = model_of(diagnosis.fit, diagnosis.target, self.data, diagnosis.numerical)
        if not diagnosis.left_out:
            return model
        names = listed([grasp.name for grasp in diagnosis.left_out])
        warning = f"fitted without {names}, {why_left_out(diagnosis)}"
        return dataclasses.replace(model, warnings=(warning, *model.warnings))

    @cached_property
    def _base_model(self) -> Model:
        return base_model(self.diagnosis.base, self.diagnosis.target, self.data)

    @property
    def answer(self) -> str:
        return f"{diagnosis_answer.answer(self.diagnosis)} {self._note}".rstrip()

    @property
    def _note(self) -> str:
        return f"Only {', '.join(self.only)} were tried." if self.only else ""

    @property
    def title(self) -> str:
        return f"What the model lacks: {self.name}"

    def to_dict(self) -> dict[str, Any]:
        return diagnosis_as_json.diagnosis_json(self.diagnosis, self.advice, self.tried, self.name)

    def sections(self) -> list[Section]:
        return diagnosis_report.sections(self.diagnosis, self.advice, self.tried)

    def commands(self, folder: Path) -> list[Command]:
        known, found, law = self.given_file or folder / BASE_MODEL, folder / FOUND_MODEL, folder / PROPOSED_LAW
        return next_step.after_diagnosis(self.diagnosis, self.advice, self.data.measured.path, known, found, law)

    def box(self, folder: Path) -> Answer:
        return answer_box(self.diagnosis, self.advice, self.commands(folder), self._note)

    def models(self) -> dict[str, Model]:
        base = {} if self.given_file else {BASE_MODEL: self._base_model}
        return base | ({FOUND_MODEL: self.model} if self.verdict.lacks_effects else {})

    def write_beside(self, folder: Path) -> None:
        super().write_beside(folder)
        if self.advice is not None:
            self.advice.next_grasp.write_commands(folder / NEXT_GRASP, self.data.gripper)
        if self.diagnosis.law is not None:
            write_law(self.diagnosis.law.law, folder / PROPOSED_LAW)

    def summary(self) -> str:
        found = f"{self.verdict} {some(self.effects)}".strip()
        fall = f"error {self.error_before:.2f} → {self.error_after:.2f} × noise, floor {self.diagnosis.floor:.2f}"
        return f"{cut(self.name)}: {found}; {fall}"


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class AddResult(Result):
    """A model with an effect added."""

    data: Loaded[MeasurementSet]
    added: Added  #: both fits
    effect: type[Effect]
    path: Path | None  #: where the model was written to

    file = "add"

    @property
    def model(self) -> Model:
        """The model with the effect."""
        return self.added.model

    @property
    def error_before(self) -> float:
        """rms error on held-out grasps, without the effect."""
        return self.added.error_before

    @property
    def error_after(self) -> float:
        """The same with it."""
        return self.added.error_after

    @property
    def answer(self) -> str:
        return fit_report.add_answer(self.added, self.effect)

    @property
    def title(self) -> str:
        return f"{self.effect.name} added: {self.name}"

    def to_dict(self) -> dict[str, Any]:
        return fit_report.add_json(self.added, self.effect, self.name, self.path or Path("model.yaml"))

    def sections(self) -> list[Section]:
        return fit_report.add_sections(self.added, self.effect)

    def commands(self, folder: Path) -> list[Command]:
        path = self.path or folder / "model.yaml"
        return [next_step.after_adding(self.data.measured.path, path, self.model.gripper)]

    def box(self, folder: Path) -> Answer:
        return fit_report.model_box(self.answer, self.model, self.commands(folder))

    def models(self) -> dict[str, Model]:
        return {"model.yaml": self.model}

    def summary(self) -> str:
        fall = f"error {self.error_before:.2f} → {self.error_after:.2f} × noise"
        return f"{cut(self.name)}: {self.effect.name} added; {fall}"


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class TableResult(Result):
    """A table of final forces against the model's static law."""

    data: Loaded[FinalForceTable]
    analysis: TableAnalysis
    file: str  #: "compare" or "diagnosis"

    @property
    def verdict(self) -> Verdict:
        """One of "one_of", "explained", "unknown" and "not_fitted"; a table alone never names one effect."""
        return self.analysis.verdict

    @property
    def effects(self) -> tuple[str, ...]:
        """What could make the shape that was found."""
        return self.analysis.effects

    @property
    def answer(self) -> str:
        lead = f"{self.verdict.replace('_', ' ').capitalize()}: {self.analysis.reason}."
        return f"{lead} It could be any of {', '.join(self.effects)}." if self.effects else lead

    @property
    def title(self) -> str:
        question = "Where the static law fails" if self.file == "compare" else "What the static law lacks"
        return f"{question}: {self.name}"

    def to_dict(self) -> dict[str, Any]:
        as_json = final_force_report.compare_json if self.file == "compare" else final_force_report.diagnosis_json
        return as_json(self.analysis)

    def sections(self) -> list[Section]:
        return final_force_report.sections(self.analysis)

    def summary(self) -> str:
        return f"{cut(self.name)}: {self.verdict} {some(self.effects) or cut(self.analysis.reason, 150)}"


#: What a model can be taken from.
ModelResult = CompareResult | FitResult | DiagnoseResult | AddResult


def base_model(base: BaseFit, target: Target, loaded: Loaded[MeasurementSet]) -> Model:
    """A fitted base model, which says if it is not to be believed."""
    numerical = numerical_error(base.fit, target)
    model = model_of(base.fit, target, loaded, numerical)
    if base.converged:
        return model
    why = (f"the fit did not converge: {base.reason}", warning_of_fit(base.fit, target, numerical))
    return dataclasses.replace(model, warnings=(*filter(None, why), *model.warnings))
