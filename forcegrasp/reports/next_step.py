"""What to do after a verb, as commands to type."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.diagnosis.advice import Advice
from forcegrasp.diagnosis.result import Diagnosis, kept_steps
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.identify.between_sets import Agreement
from forcegrasp.identify.comparison import Comparison
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.noise_floor import at_floor
from forcegrasp.identify.verdict import Verdict
from forcegrasp.measure import MeasurementSet
from forcegrasp.physics.gripper import Gripper
from forcegrasp.reports.diagnosis_words import besides, is_not_all
from forcegrasp.reports.html import Command
from forcegrasp.reports.physics_step import shorter_step


def train_command(model: str | Path, gripper: str) -> str:
    """What to type to train with a model of this gripper."""
    return _line("train", f"model={model}", *([] if gripper == DEFAULT_GRIPPER else [f"gripper={gripper}"]))


def after_diagnosis(
    diagnosis: Diagnosis,
    advice: Advice | None,
    data: str | Path,
    known: str | Path,
    found: str | Path,
    law: str | Path = "law.yaml",
) -> list[Command]:
    """What to do after a diagnosis, the best first.

    Args:
      diagnosis: what was found.
      advice: the next grasp, if there is one that tells rivals apart.
      data: the set.
      known: file of the model that was diagnosed.
      found: file of the model with the effects that were found.
      law: file of the law, if one was found.
    """
    d, again = diagnosis, _line("diagnose", f"data={data}")
    gripper, compared = d.target.gripper, _line("compare", f"data={data}", f"model={known}")
    if d.stopped and d.verdict.lacks_effects:
        return [Command("go on from what was found", _line("diagnose", f"data={data}", f"model={found}"))]
    if d.stopped:
        leads = [
            Command(f"see what {lead.effect} does", line_that_adds(data, known, lead.effect)) for lead in d.leads[:1]
        ]
        return [Command("give it more time", again), *leads]
    shorter = shorter_step(d)
    finer = [] if shorter is None else [Command(f"make the scene's timestep {shorter:g} s, and diagnose again", again)]
    if d.verdict is Verdict.NOT_FITTED:
        return [*finer,
                Command("look for what went wrong in single recordings" if gripper.is_servo
                        else "look for grasps that went wrong", _line("compare", f"data={data}"))]  # fmt: skip
    if d.verdict is Verdict.DATA:
        return [Command("put the set right, and diagnose again", again)]
    is_wrong = d.fault is not None and d.fault.moved is None and not d.fault_is_rival
    right = [Command("put the set right first, and diagnose again", again)] if is_wrong else []
    with_it = found if d.verdict.lacks_effects else known
    by_law = [] if d.law is None else [Command("add the law that was found", line_that_adds(data, with_it, law))]
    if d.verdict is Verdict.UNKNOWN:
        look = Command("look at where the model fails", compared)
        return [*right, *finer, *by_law, look, *([] if d.law_sought else [_for_a_law(data)])]
    if d.verdict is Verdict.EXPLAINED:
        misstated = d.noise is not None and not d.noise.has_tails_alone and d.clock_jitter is None
        noise = [Command("give the noise as it is, and diagnose again", again)] if misstated else []
        return [*noise, _use("the model", known, data, gripper)]
    first = next(iter(d.shares()), d.effects[0])  # rounding is in the noise already
    added = Command(
        f"add {first} alone" if len(d.shares()) > 1 else "add it",
        line_that_adds(data, known, first),
    )
    with_all = f"the model that has {listed(d.preferred)}"
    if d.verdict is Verdict.ONE_OF:
        preferred = Command(f"until then take {first}, which is preferred", added.line)
        if len(d.shares()) > 1:
            use = _use(with_all, found, data, gripper)
            preferred = Command(f"until then {use.purpose}", use.line)
        tied = next((step.effects for step in kept_steps(d.steps) if len(step.effects) > 1), ())
        joined = _line("diagnose", f"data=[{str(data).strip('[]')},next]") if advice is not None and tied else again
        return [
            *finer,
            Command(_to_tell_apart(d, tied, advice), joined),
            *([] if effect_of(first, gripper).of_set else [preferred]),
            *by_law,
        ]
    if is_not_all(d):
        look = Command(f"look at what {with_all} leaves", _line("compare", f"data={data}", f"model={found}"))
        more = besides(d)
        tried = [] if more is None else [
            Command(f"see what {more.effect.name} does besides", line_that_adds(data, found, more.effect.name))
        ]  # fmt: skip
        return [*right, *finer, *by_law, look, *tried, *([] if d.law_sought else [_for_a_law(data)]), added]
    return [*right, *by_law, _use(with_all, found, data, gripper), added]


def _for_a_law(data: str | Path) -> Command:
    return Command(
        "look for a formula of what is left; it takes minutes", _line("diagnose", f"data={data}", "law=true")
    )


def next_grasp_words(measured: MeasurementSet, diagnosis: Path) -> str:
    """What the file with the commands of the next grasp is for; ``diagnosis`` is the JSON file beside it."""
    if measured.source.startswith("simulated by forcegrasp record"):
        return f"its commands. Simulated, it takes the command that recorded the set, with next={diagnosis} out=next"
    return "its commands, a row at each control period; play them, and log the readings as a set such as next"


def _to_tell_apart(diagnosis: Diagnosis, tied: Sequence[str], advice: Advice | None) -> str:
    """What tells rivals apart: those of a step, ``tied``, and what may be wrong with the set instead of the model."""
    rivals, fault = [effect_of(name, diagnosis.target.gripper) for name in tied], diagnosis.fault
    faults = "".join(f"check {e.name} in the set ({e.separates}); " for e in rivals if e.of_set)
    if fault is not None and diagnosis.fault_is_rival:
        faults += "".join(f"check {one.name} in the set ({one.check}); " for one in fault.all)
    if not tied:
        return f"{faults}put right what is wrong there, and diagnose again"
    if advice is not None:
        said = advice.sentence().replace("record next:", "record", 1)
        return f"{faults}{said}. Make a set of it, such as next, and diagnose both"
    telling = "; ".join(f"{effect.name}: {effect.separates}" for effect in rivals if not effect.of_set)
    return f"{faults}record what tells them apart ({telling}), and diagnose again"


def line_that_adds(data: str | Path, model: str | Path, effect: str | Path) -> str:
    """The command that adds an effect, or the file of a law, to a model."""
    return _line("add", f"data={data}", f"model={model}", f"effect={effect}", "out=better.yaml")


def after_comparison(comparison: Comparison, data: str | Path, model: str | Path) -> list[Command]:
    """What to do after a comparison with this model."""
    differ = comparison.between.of(Agreement.DIFFERS) if comparison.between else []
    if comparison.between and differ:
        why = f"for {listed([one.name for one in differ[:3]])} differ{'s' if len(differ) == 1 else ''}"
        return [
            Command(f"diagnose {one.name} by itself, {why}", _line("diagnose", f"data={one.path}", f"model={model}"))
            for one in comparison.between.sets
        ]
    if at_floor(comparison.floor_ratio(), comparison.floor):
        servo = comparison.target.gripper.is_servo  # what it leaves was shown just now
        return [] if servo else [_use("the model", model, data, comparison.target.gripper)]
    return [after_fit(data, model)]


def after_fit(data: str | Path, model: str | Path) -> Command:
    """What to do with a base model."""
    return Command(
        "find out which effect is missing, or what the set gives that is a little off",
        _line("diagnose", f"data={data}", f"model={model}"),
    )


def after_adding(data: str | Path, model: str | Path, gripper: Gripper) -> Command:
    """What to do with a model that has one more effect."""
    if gripper.is_servo:
        return Command("see what is left", _line("compare", f"data={data}", f"model={model}"))
    return Command("train with it", train_command(model, gripper.name_or_path))


def _use(what: str, model: str | Path, data: str | Path, gripper: Gripper) -> Command:
    """What a model that lacks nothing is for."""
    if gripper.is_servo:
        return Command(f"see what {what} leaves", _line("compare", f"data={data}", f"model={model}"))
    return Command(f"train with {what}", train_command(model, gripper.name_or_path))


def _line(verb: str, *options: str) -> str:
    return shlex.join(["forcegrasp", verb, *options])
