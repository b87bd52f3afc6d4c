"""Sentences about a diagnosis: what the model lacks, how much is left, and what the noise is."""

from __future__ import annotations

from forcegrasp.diagnosis.result import Diagnosis, Step, kept_steps
from forcegrasp.diagnosis.verdict import EXPLAINED_FAR, MUCH
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.verdict import Verdict
from forcegrasp.reports.comparison import covariate_words, words
from forcegrasp.reports.findings import where


def lacks(diagnosis: Diagnosis) -> str:
    """The effects that were found, what else they could be, and how much they leave, in one sentence."""
    steps = kept_steps(diagnosis.steps)
    if diagnosis.verdict is Verdict.DATA and not steps:
        seems = f"Not the model but the set seems to be wrong: {odd_words(diagnosis)}"
        return f"{seems}. Put their labels right, or leave them out."
    if diagnosis.verdict is Verdict.DATA:
        return f"Not the model but the set seems to be wrong: {listed([_fault(step, diagnosis) for step in steps])}."
    if len(steps) == 1 and len(steps[0].effects) > 1:
        names = f"{listed(steps[0].effects, 'or')}: {_undecided(steps[0])}"
    else:
        names = listed([_with_rivals(step) for step in steps])
    return f"The model lacks {names}{_but(diagnosis)}."


def odd_words(diagnosis: Diagnosis) -> str:
    """Grasps that a fit of all others misses by far, in words; empty if there are none."""
    if not diagnosis.odd:
        return ""
    named = listed([str(grasp) for grasp in diagnosis.odd])
    as_other = " fit as grasps of another object" if all(g.like for g in diagnosis.odd) else " fit no object of the set"
    return f"{named}{as_other}, judged by a fit of all others"


def _fault(step: Step, diagnosis: Diagnosis) -> str:
    effect = effect_of(step.effects[0], diagnosis.target.gripper)
    return f"{effect.name} ({effect.symptom}; to check: {effect.separates})"


def shares_sentence(diagnosis: Diagnosis) -> str:
    """How much of the error each effect explains, and how much is left."""
    shares = diagnosis.shares()
    parts = [f"{name} explains {share:.0%}" for name, share in shares.items()]
    return (
        f"of the mean square error beyond the noise {listed(parts)}; {max(0.0, 1 - sum(shares.values())):.0%} is left"
    )


def _with_rivals(step: Step) -> str:
    first, *rivals = step.effects
    return f"{first} (or {listed(rivals, 'or')}: {_undecided(step)})" if rivals else first


def _undecided(step: Step) -> str:
    return f"these data can't tell which, and {step.effects[0]} is preferred, for {preference(step)}"


def preference(step: Step) -> str:
    """Why the first of the effects that can't be told apart is preferred; empty if there is one only."""
    if len(step.effects) < 2:
        return ""
    first, *others = (len(candidate.effect.parameters) for candidate in step.candidates[: len(step.effects)])
    if all(first < other for other in others):
        return "it has fewer parameters"
    if all(first == other for other in others):
        return "its held-out gain is larger"
    return "it has fewer parameters or a larger held-out gain"


def _but(diagnosis: Diagnosis) -> str:
    d = diagnosis
    if not d.left or (d.error_after <= MUCH * d.floor and d.explained >= EXPLAINED_FAR):
        return ""
    return (
        f"; but that is not all, for {d.error_after:.2f} × the sensor noise is left on held-out {d.target.part}s where"
        f" {d.floor:.2f} would be noise ({d.explained:.0%} of the mean square beyond it is explained)"
    )


def left_sentence(diagnosis: Diagnosis) -> str:
    """Where the rest of the error is, in words."""
    rest = where(diagnosis)
    place = f"{words(rest['signal'])}, {words(rest['phase'])}: {rest['ratio']:.1f} × noise"
    if not diagnosis.left:
        return f"what is left is noise; it is largest in {place}"
    name, share = next(iter(rest["explained_by"].items()))
    goes = f", of which {share:.0%} goes with {covariate_words(name)}" if share > 0.05 else ""
    return (
        f"what is left is largest in {place}{goes}; a better model could explain {rest['explainable']:.0%} of the"
        " remaining mean square error at most"
    )


def noise_words(diagnosis: Diagnosis) -> str:
    """What the noise is and what to do about it, if it is not as assumed; empty otherwise."""
    noise, source = diagnosis.noise, "given" if diagnosis.target.sigma_known else "estimated"
    if noise is None:
        return ""
    parts, names = [], diagnosis.target.axis.names
    for kind, part in diagnosis.target.axis.kinds.items():
        ratio = noise.ratio[part]
        if all(noise.affected[part]) and max(ratio) < 1.15 * min(ratio):
            parts.append(_scatter(f"{kind}s", float((ratio**2).mean() ** 0.5), any(noise.heavy_tails[part])))
            continue
        signals = range(part.start, part.stop)
        parts += [_scatter(words(names[k]), noise.ratio[k], noise.heavy_tails[k]) for k in signals if noise.affected[k]]
    sizes = f"{', '.join(parts)} the noise that was {source}"
    again = "give position_std_m and force_std_n as they are in meta.yaml, and diagnose again: a small effect may show"
    if not noise.stronger:
        return f"But the noise is smaller than that: {sizes}. What is smaller than the noise can't be seen; {again}."
    return (
        f"But the noise is not what was {source}: {sizes}. The residuals are white in time and alike in all phases,"
        f" which no missing effect makes. To do: {again}."
    )


def _scatter(what: str, ratio: float, heavy: bool) -> str:
    return f"{what} scatter by {ratio:.2g} ×" + (" (with heavy tails)" if heavy else "")
