"""Goes on where effects leave something that the tolerance of what a set gives would explain."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from forcegrasp.diagnosis.evidence import LEAST_LEAD, LEAST_SHARE_OF_MANY, is_beyond_chance, rivals_in
from forcegrasp.diagnosis.families import refit_without, roughly_as, roughly_without
from forcegrasp.diagnosis.faults.fault import Fault, besides
from forcegrasp.diagnosis.faults.session_zeros import session_zeros
from forcegrasp.diagnosis.faults.tolerance import MOST, RULER_M, WORTH, Moved, all_radii, first_move, time_of_reading
from forcegrasp.diagnosis.faults.wrong_radii import within_tolerance
from forcegrasp.diagnosis.few import with_few
from forcegrasp.diagnosis.givens.lost_motion import with_lost_motion
from forcegrasp.diagnosis.result import Candidate, Diagnosis, Step, kept_steps
from forcegrasp.diagnosis.search.judge import judged
from forcegrasp.diagnosis.search.needless import drop_all_needless
from forcegrasp.diagnosis.signatures import direction
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import LEAST_SHARE, MUCH
from forcegrasp.effects import Effect
from forcegrasp.effects.object_size import ObjectSize
from forcegrasp.effects.readout_skew import ReadoutSkew
from forcegrasp.identify.base_fit import BaseFit
from forcegrasp.identify.cross_validation import evidence_folds
from forcegrasp.identify.fit import Fit, fit_exactly
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.noise_floor import beyond_fit
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.progress import Progress
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target
from forcegrasp.identify.verdict import Verdict
from forcegrasp.measure import MeasurementSet

#: Searches on from a base model, a fit with effects besides, and the steps that found these.
SearchOn = Callable[[Target, Simulators, BaseFit, Fit, Sequence[Step]], Diagnosis]

# Where a move within the tolerance would take off this share of what a model leaves, it comes before unlikely effects:
# they are then looked for in what it leaves.
_COMES_FIRST = 0.25
# Squares that one more number costs, as a move's price has it.
_OF_SIZE = 2.0


@dataclass(eq=False)
class MovesFirst:
    """Whether moves within the tolerance are to be tried before effects that promise little."""

    loaded: Loaded[MeasurementSet]
    ask_sessions: bool = True  #: whether zeros of sessions may come first
    asked: bool = False  #: whether moves were to be tried first, or zeros, of any fit
    beyond: bool = False  #: whether radii are to be moved beyond their tolerance, as if a ruler had measured them
    zeros: bool = False  #: whether zeros of sessions come first, of the last fit that was asked for

    def __call__(self, target: Target, fit: Fit) -> bool:
        step = first_move(self.loaded.measured, target, fit, _COMES_FIRST)
        first = step is not None and step[0].is_within
        self.asked |= first
        return first

    def explain(self, target: Target, fit: Fit) -> bool:
        """Whether moves within the tolerance explain most of what a fit leaves, and leave little."""
        return _most_explained(self.loaded.measured, target, fit) is not None

    def before_more(self, target: Target, fit: Fit) -> bool:
        """Whether moves explain most of what effects leave, and leave little, so that they come before more effects.

        Not where radii are moved down alike: pads that stand further out, or lost motion, would have them so. Of zeros
        of sessions some is enough, as of an effect.
        """
        measured = self.loaded.measured
        # places of all grasps would do as well, and be many more
        self.zeros = self.ask_sessions and session_zeros(target, fit) is not None
        first = self.zeros or self.explain(target, fit)
        if not first and measured.radius_std_m < RULER_M:
            moved = _most_explained(dataclasses.replace(measured, radius_std_m=RULER_M), target, fit)
            # if all are off alike it may be an effect
            first = self.beyond = moved is not None and moved.radii_differ_by_m > MOST * measured.radius_std_m
        self.asked |= first
        return first


def _most_explained(measured: MeasurementSet, target: Target, fit: Fit) -> Moved | None:
    """A move within the tolerance that explains most of what effects leave, and leaves little; None if none does."""
    moved, left = first_move(measured, target, fit, WORTH) or (None, np.inf)
    return None if moved is None or not moved.is_within or moved.smaller_m or left > MUCH else moved


def within_tolerance_after_all(found: Diagnosis, loaded: Loaded[MeasurementSet]) -> Diagnosis:
    """The diagnosis without an error of all radii that is smaller than what they are given with: it is told as moved.

    Args:
      found: of the set as it is.
      loaded: the set.
    """
    step = next((step for step in kept_steps(found.steps) if step.effects == (ObjectSize.name,)), None)
    if step is None or found.left or found.fault is not None:
        return found
    (move_m,) = found.fit.effect(ObjectSize.name).values.tolist()
    moved = all_radii(loaded.measured, found.target, move_m)
    if moved is None:
        return found
    fault = Fault("object_tolerance", f"all radii by {1e3 * move_m:+.2g} mm", moved.check, loaded, moved)
    return _told_as_moved(found, step, fault)


def timing_within_tolerance_after_all(found: Diagnosis, loaded: Loaded[MeasurementSet]) -> Diagnosis:
    """The diagnosis without positions that are late by no more than the set's tolerance: that is told as moved.

    Another integrator is half a step ahead or behind, and such a delay takes a little off whatever else is missing.

    Args:
      found: of the set as it is, or moved or put right.
      loaded: the set.
    """
    step = next((step for step in kept_steps(found.steps) if step.effects == (ReadoutSkew.name,)), None)
    if step is None or not step.candidates or loaded.gripper.is_servo or found.fault_is_rival:
        return found
    (delay_s,) = found.fit.effect(ReadoutSkew.name).values.tolist()
    moved = time_of_reading(loaded.measured, found.target, delay_s)
    if moved is None:
        return found
    right = loaded if found.fault is None else found.fault.put_right
    fault = Fault("timing_tolerance", moved.words(), moved.check, right, moved)
    if found.fault is not None:
        fault = besides(found.fault, fault)
    return _told_as_moved(found, step, fault)


def _told_as_moved(found: Diagnosis, step: Step, fault: Fault) -> Diagnosis:
    """The diagnosis without a step whose one effect is a move within the tolerance."""
    steps = tuple(one for one in found.steps if one is not step)
    others, verdict = tuple(name for name in found.effects if name not in step.effects), found.verdict
    if not others:
        verdict = Verdict.UNKNOWN if found.left else Verdict.EXPLAINED
    return dataclasses.replace(found, verdict=verdict, effects=others, steps=steps, fault=fault)


def go_on_with_moved(
    found: Diagnosis,
    loaded: Loaded[MeasurementSet],
    search_on: SearchOn,
    progress: Progress,
    effects: Sequence[type[Effect]] = (),
) -> tuple[Diagnosis, Simulators] | None:
    """The diagnosis of a set whose givens were moved within their tolerance; None if nothing asks for a move.

    A hidden effect hides what is a little off besides, until it is in the model. What was taken for an effect may then
    have been the objects' sizes: effects that are no longer needed are left out.

    Args:
      found: of the set as it is.
      loaded: the set.
      search_on: looks for further effects.
      progress: told what is going on.
      effects: the catalogue.
    """
    if not found.left or loaded.gripper.is_servo or found.verdict in (Verdict.NOT_FITTED, Verdict.DATA):
        return None
    models = [_with_move(model, loaded) for model in _models(found)]
    best = min((one for one in models if one.fault is not None), key=lambda one: one.price, default=None)
    if best is None:
        return None
    sizeless = _without_size(found, loaded)
    if sizeless is not None and sizeless.price < best.price + _OF_SIZE:
        best, models = sizeless, [sizeless]
    if best.fault is None:
        return None
    progress(f"fitting with {best.fault.words}")
    target, simulators = best.target, Simulators(best.fit.problem)
    numerical = beyond_fit(best.fit, found.numerical)
    study = with_few(Study(target, simulators, evidence_folds(target.grasps), numerical, progress), best.fit)
    if not is_beyond_chance(_lead(best, _Model(found.fit, found.target, []), study), LEAST_LEAD):
        return None
    steps = _with_rivals_that_do_as_well(best, models, study)
    lost = _with_lost_motion(best, loaded, effects, study)
    if lost is not None:
        best, steps, target, simulators = lost, lost.steps, lost.target, Simulators(lost.fit.problem)
        study = with_few(dataclasses.replace(study, target=target, simulators=simulators, few=None), lost.fit)
    given = len(found.base.fit.problem.effects)
    steps, fit = drop_all_needless(study, steps, best.fit, given)
    steps, bare = one_after_the_other(study, steps, fit)
    again = search_on(target, simulators, dataclasses.replace(found.base, fit=bare), fit, steps)
    before, after = found.error_before, again.error_before
    return dataclasses.replace(again, fault=best.fault, error_before=before, error_moved=after), simulators


@dataclass(frozen=True, eq=False)
class _Model:
    """A model with all that was found, or with a rival in the place of an effect that it can't be told from."""

    fit: Fit
    target: Target
    steps: list[Step]
    place: int = -1  #: of the step whose rival it has; none by default
    fault: Fault | None = None  #: what was moved, if that explains some of what the model leaves

    @property
    def move_costs(self) -> float:
        """See :attr:`.Moved.price`."""
        return 0.0 if self.fault is None or self.fault.moved is None else self.fault.moved.price

    @property
    def price(self) -> float:
        """Squares that it leaves, and those that its move is worth."""
        return self.fit.cost + 2 * self.move_costs


def _models(found: Diagnosis) -> Iterator[_Model]:
    """The final model, and then each that has a rival, fitted roughly: what it is moved by is not known yet.

    An encoder's scale and objects that are all too large are nearly the same, but for what is given of each object.
    """
    steps = kept_steps(found.steps)
    yield _Model(found.fit, found.target, steps)
    study = Study(found.target, Simulators(found.fit.problem), found.folds)
    for place, step in enumerate(steps):
        for rival in rivals_in(step, found.fit):
            name = rival.effect.name
            candidates = (rival, *(c for c in step.candidates if c is not rival))
            effects = (name, *(n for n in step.effects if n != name))
            first = dataclasses.replace(step, effects=effects, candidates=candidates)
            fit = roughly_as([rival.setting], found.fit, step.effects[0], study)
            yield _Model(fit, found.target, [*steps[:place], first, *steps[place + 1 :]], place)


def _without_size(found: Diagnosis, loaded: Loaded[MeasurementSet]) -> _Model | None:
    """The final model on the set as moved, without one size that all objects are off by; None if it has none.

    Where each radius is a little off that is their mean, and hides that each is within its tolerance.
    """
    steps = kept_steps(found.steps)
    others = [step for step in steps if step.effects[0] != ObjectSize.name]
    if len(others) == len(steps):
        return None
    study = Study(found.target, Simulators(found.fit.problem), found.folds)
    fit = roughly_without(ObjectSize.name, found.fit, study)
    moved = _with_move(_Model(fit, found.target, others), loaded)
    if moved.fault is None:
        return None
    again = _with_move(moved, loaded, moved.fault.moved)  # slopes led from where sizes were, which is further off
    return min([moved, again], key=lambda one: one.price)


def _with_move(model: _Model, loaded: Loaded[MeasurementSet], start: Moved | None = None) -> _Model:
    """The model on the set as moved, if a move within the tolerance explains some of what it leaves.

    Args:
      model: of the set as it is, or as it was moved to start with.
      loaded: the set.
      start: how it was moved.
    """
    # of a law that is not known some may look like a move
    worth = LEAST_SHARE_OF_MANY if model.steps else LEAST_SHARE
    fault = within_tolerance(loaded, model.target, model.fit, worth, start)
    if fault is None and model.place < 0:
        return model
    grasps = model.target.grasps if fault is None else fault.put_right.measured.grasps
    target = dataclasses.replace(model.target, grasps=grasps)
    problem = Problem(loaded.gripper, target.grasps, model.fit.problem.case(model.fit.vector).effects)
    fit = fit_exactly(target, problem, Simulators(problem), model.fit.vector, model.fit.jacobian)
    return dataclasses.replace(model, fit=fit, target=target, fault=fault)


def _with_lost_motion(
    moved: _Model,
    loaded: Loaded[MeasurementSet],
    effects: Sequence[type[Effect]],
    study: Study,
) -> _Model | None:
    """The model with lost motion besides, and other moves; None if it is no likelier, or nothing hints at it.

    Args:
      moved: the model on the set as moved.
      loaded: the set.
      effects: the catalogue.
      study: the measurements as moved.
    """
    if moved.fault is None or moved.fault.moved is None:
        return None
    tried = with_lost_motion(moved.fit, moved.target, moved.fault.moved, loaded.measured, effects, study.progress)
    for rough, start in tried:
        lost = _with_move(_Model(rough, moved.target, moved.steps), loaded, start)
        if lost.fault is None or not is_beyond_chance(_lead(lost, moved, study), LEAST_LEAD):
            continue
        setting, held = lost.fit.effects[-1], study.heldout(moved.fit)
        by_chance = float(chi2.sf(moved.price - lost.price, len(setting.values)))
        candidate = judged(study, held, lost.fit, setting, by_chance, direction(moved.fit, lost.fit))
        candidate = dataclasses.replace(candidate, without=moved.fit)
        study.progress(f"{setting.effect.name} and {lost.fault.words} leave less")
        step = Step((setting.effect.name,), (candidate,), (), study.error(held), candidate.error_after)
        return dataclasses.replace(lost, steps=[*moved.steps, step])
    return None


def _lead(best: _Model, other: _Model, study: Study) -> np.ndarray:
    """By how much each held-out grasp speaks for a model and its move, and against another, ``(G,)``."""
    gains = study.gains(study.heldout(other.fit), study.heldout(best.fit))
    return gains - (best.move_costs - other.move_costs) / len(gains)


def _with_rivals_that_do_as_well(best: _Model, models: Sequence[_Model], study: Study) -> list[Step]:
    """The steps of the best model, tied with those rivals that its move does not tell from it; all as theirs has them.

    What others left before the move is no measure of them now.
    """
    steps = [dataclasses.replace(step, candidates=step.candidates[:1], effects=step.effects[:1]) for step in best.steps]
    for other in models:
        place = other.place if best.place < 0 else best.place
        if other is best or (best.place >= 0 and other.place not in (-1, place)):
            continue
        step, own = steps[place], best.steps[place].candidates[0]
        rival, lead = other.steps[place].candidates[0], _lead(best, other, study)
        setting = other.fit.effect(rival.effect.name)
        error = study.error(study.heldout(other.fit))
        rival = dataclasses.replace(rival, setting=setting, fit=other.fit, gains=own.gains - lead, error_after=error)
        least = LEAST_LEAD if own.effect.of_set != rival.effect.of_set else 0.0
        tied = len(step.effects)
        if is_beyond_chance(lead, least):
            steps[place] = dataclasses.replace(step, candidates=(*step.candidates, rival))
        else:
            candidates = (*step.candidates[:tied], rival, *step.candidates[tied:])
            steps[place] = dataclasses.replace(step, effects=(*step.effects, rival.effect.name), candidates=candidates)
    return steps


def one_after_the_other(study: Study, steps: Sequence[Step], fit: Fit) -> tuple[list[Step], Fit]:
    """The steps with what each effect explains of what the move of the set leaves; and a fit without any of them.

    Args:
      study: the measurements, as moved.
      steps: that found the effects.
      fit: with all effects.
    """
    error, found, later = study.error(study.heldout(fit)), list(steps), []
    for place, step in reversed(list(enumerate(steps))):
        if step.is_counted:
            found[place] = dataclasses.replace(step, error_before=error, error_after=error)
            continue
        first = dataclasses.replace(step.candidates[0], setting=fit.effect(step.effects[0]), fit=fit, error_after=error)
        fit, after = refit_without(step.effects[0], fit, study), error
        error = study.error(study.heldout(fit))
        rivals = [_before(later, one, study) for one in step.candidates[1:]]
        later.append(step.effects[0])
        candidates = (first, *rivals)
        found[place] = dataclasses.replace(step, candidates=candidates, error_before=error, error_after=after)
    return found, fit


def _before(later: Sequence[str], rival: Candidate, study: Study) -> Candidate:
    """A rival with the error that it leaves while these effects, which were found after it, are not in its model."""
    if not later:
        return rival
    return dataclasses.replace(rival, error_after=study.error(study.heldout(refit_without(later, rival.fit, study))))
