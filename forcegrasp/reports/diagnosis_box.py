"""The box above the report of a diagnosis: what, how sure, the runner-up, what is left, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence

from forcegrasp.diagnosis.advice import Advice
from forcegrasp.diagnosis.result import Candidate, Diagnosis, Step, kept_steps
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.verdict import Verdict
from forcegrasp.reports.diagnosis_answer import answer
from forcegrasp.reports.diagnosis_words import (
    besides_sentence,
    fault_words,
    foretells_no_better,
    is_not_all,
    is_of_labels,
    jitter_sentence,
    lacks,
    left_out_words,
    left_sentence,
    left_share,
    noise_words,
    odd_words,
    percent,
    shares_sentence,
    stopped_words,
)
from forcegrasp.reports.html import Answer, Command
from forcegrasp.reports.law import law_words
from forcegrasp.reports.physics_step import step_warning
from forcegrasp.short_repr import as_sentence

# Below so many times the floor noise of another kind may be all that is left.
_SURELY = 1.2


def answer_box(diagnosis: Diagnosis, advice: Advice | None, commands: Sequence[Command], note: str = "") -> Answer:
    """The answer and what it is worth.

    Args:
      diagnosis: what was found.
      advice: the next grasp, if there is one.
      commands: what to do next, the best first.
      note: what else to bear in mind.
    """
    d, found = diagnosis, diagnosis.verdict.names_effects
    shares = d.shares() if found else {}
    shares |= {"left" if d.left else "noise": left_share(d)} if shares else {}
    fall = f"{d.error_of_base:.2f} → {d.error_after:.2f} × the sensor noise on held-out {d.target.part}s"
    left, left_out = left_sentence(d).removeprefix("what is left is "), left_out_words(d).removeprefix("Left out: ")
    # of rivals the next command tells which grasp to record
    record = advice.sentence().removeprefix("record next: ") if advice and d.verdict is not Verdict.ONE_OF else ""
    fault = d.fault if d.verdict is Verdict.DATA and not kept_steps(d.steps) else None  # that is all that was found
    what = lacks(d) if found else answer(d)
    if fault is not None:
        what = f"Not the model but the set seems to be wrong: {listed(fault.names)}."
    shows_rest = (found or d.verdict is Verdict.UNKNOWN) and not is_of_labels(d)
    rows = [
        ("Not finished", stopped_words(d) if found else ""),
        ("Left out", left_out[:1].upper() + left_out[1:] if found else ""),
        ("The set", fault_words(d) if found else ""),
        ("What is wrong", " ".join(as_sentence(one.words) for one in fault.all) if fault else ""),
        ("To check", " ".join(as_sentence(one.check) for one in fault.all) if fault else ""),
        ("Explains", shares_sentence(d) if found else ""),
        ("Error", f"{fall}; up to {d.floor:.2f} is noise." if (found and d.steps) or fault else ""),
        ("How sure", certainty(d)),
        ("Runner-up", runner_up(d) if d.verdict.lacks_effects else ""),
        ("What is left", as_sentence(left) if shows_rest else ""),
        ("Perhaps", f"{more}." if (more := besides_sentence(d)) else ""),
        ("A law", f"{law_words(d.law)}." if d.law is not None else ""),
        ("Noise", noise_words(d) if found else ""),
        ("Time stamps", as_sentence(jitter) if (jitter := jitter_sentence(d)) else ""),
        ("Physics step", as_sentence(step) if (step := step_warning(d)) else ""),
        ("Look first at", f"{odd_words(d)}." if d.odd and d.steps else ""),
        ("Record next", f"{record}." if record else ""),
        ("Note", note),
    ]
    return Answer(
        what,
        [(name, text) for name, text in rows if text],
        [(f"{name} {percent(share)}", share) for name, share in shares.items()],
        commands,
    )


def certainty(diagnosis: Diagnosis) -> str:
    """How sure the verdict is: as sure as its weakest step."""
    d, weakest = diagnosis, weakest_step(diagnosis)
    judged = f"on {d.target.part}s held out of the fit"
    if d.verdict is Verdict.NOT_FITTED:
        return "Nothing can be said before the base model is fitted."
    if d.verdict is Verdict.EXPLAINED:
        return f"No effect lowers the error {judged} by more than chance. Effects that leave no trace are not excluded."
    if d.verdict is Verdict.UNKNOWN:
        error = f"the error {judged} is {d.error_after:.2f} × the sensor noise, and {d.floor:.2f} would be noise"
        if d.error_after > _SURELY * d.floor:
            return f"Sure that something is missing: {error}. What it is, is not known."
        return (
            f"Something small seems to be missing: {error}. Noise that is neither even nor white would look alike: a"
            " motion that is recorded twice tells them apart."
        )
    if weakest is None and d.fault is not None:
        share = f"{d.error_after / d.error_before:.0%} of the error that they had"
        return f"Judged {judged}: with the set put right {share} is left, and no effect lowers it by more than chance."
    if weakest is None:
        return f"Judged by a fit of all other {d.target.part}s." if d.odd else "Counted, not fitted: it is certain."
    name, p = weakest.effects[0], weakest.candidates[0].p_family
    several = len(kept_steps(d.steps)) > 1
    if len(weakest.effects) > 1:
        step = "Its weakest step decides: " if several else ""
        return f"{step}Something is missing, but {listed(weakest.effects, 'and')} explain these data alike."
    if name in d.doubted:
        return f"Its weakest step decides: {name} lowers the error {judged}, but may not be there."
    noise = f"noise alone does as well with a probability of {p:.2g} at most, whichever effect is tried"
    which = f"{name}, the weakest, is clear" if several else "Clear"
    others = "no effect but those that contain it does" if _containing(weakest) else "no other effect does"
    clear = f"{which} {judged}: {others} as well, and {noise}."
    perhaps = "perhaps " if foretells_no_better(d) else ""
    return f"{clear} But {perhaps}not all is found." if is_not_all(d) else clear


def weakest_step(diagnosis: Diagnosis) -> Step | None:
    """The step on which the verdict rests least firmly; None if none was fitted."""
    fitted, doubted = [step for step in kept_steps(diagnosis.steps) if step.candidates], diagnosis.doubted
    return max(
        fitted,
        key=lambda s: (len(s.effects) > 1, s.effects[0] in doubted, s.candidates[0].p_family, *_leads(s, diagnosis)),
        default=None,
    )


def _leads(step: Step, diagnosis: Diagnosis) -> tuple[float, float]:
    """What the best effect that was not found gains, of what the one that was found gains; and how little that is."""
    other, gain = _best_other(step, diagnosis), step.candidates[0].heldout_gain
    return max(0.0, other.heldout_gain) / max(gain, 1e-9) if other else 0.0, -gain


def _best_other(step: Step, diagnosis: Diagnosis) -> Candidate | None:
    """The best of the effects that no step has found; not of those that contain what was found, and fit as well."""
    found = {*step.effects, *diagnosis.preferred}
    others = [c for c in step.candidates if c.effect.name not in found and c.is_plausible]
    others = [c for c in others if c not in _containing(step)]
    return max(others, key=lambda c: c.heldout_gain, default=None)


def _containing(step: Step) -> list[Candidate]:
    """Candidates that contain the effect that was found."""
    return [c for c in step.candidates if step.effects[0] in {nested.effect for nested in c.effect.contains}]


def runner_up(diagnosis: Diagnosis) -> str:
    """What came next to the weakest of the effects that were found, in words; empty if nothing was found."""
    step = weakest_step(diagnosis)
    if step is None:
        return ""
    first, *rivals = step.candidates[: len(step.effects)]
    if rivals:
        left = [f"{c.effect.name} leaves {c.error_after:.2f} × noise" for c in rivals]
        return f"{listed(left)}, {first.effect.name} {first.error_after:.2f}."
    other, richer = _best_other(step, diagnosis), [c.effect.name for c in _containing(step)]
    contains = f" {listed(richer)} would add little to {first.effect.name}, contained in it." if richer else ""
    if other is None and diagnosis.error_moved is not None:
        return contains.lstrip()  # what others left before the set was moved is no measure
    if other is None or other.heldout_gain <= 0:
        return f"None: no other effect explains any of what {first.effect.name} does.{contains}"
    gains = f"held-out gain {other.heldout_gain:+.0f} beside {first.heldout_gain:+.0f}"
    return (
        f"{other.effect.name}, which leaves {other.error_after:.2f} × noise where {first.effect.name} leaves"
        f" {first.error_after:.2f} ({gains}).{contains}"
    )
