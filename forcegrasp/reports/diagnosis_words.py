"""Sentences about a diagnosis: what the model lacks, how much is left, and what the noise is."""

from __future__ import annotations

import numpy as np

from forcegrasp.diagnosis.evidence import may_be_besides
from forcegrasp.diagnosis.faults.fault import Fault
from forcegrasp.diagnosis.givens.late_rows import row_s
from forcegrasp.diagnosis.result import Candidate, Diagnosis, Step, kept_steps
from forcegrasp.diagnosis.search.forms import FORM_TOLERANCE
from forcegrasp.diagnosis.verdict import EXPLAINED_FAR, MUCH
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.identify.cross_validation import heldout_residual, rms_of_recordings
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.verdict import Verdict
from forcegrasp.reports.comparison import covariate_words, words
from forcegrasp.reports.findings import found_parameters, where
from forcegrasp.short_repr import counted

# An answer that leaves more than so many times the floor says so first.
_MORE = 1.2

# So many effects can make up for one that was not found.
_MANY = 5

# A delay is one of whole rows if it is that close to it.
_WHOLE = 0.1

# Of all that is left, a phase that has so much is where it is.
_NEARLY_ALL = 0.8

# A set that was moved shows so if it leaves this share of the error, before any effect.
_SHOWS = 0.99

# Noise is slow altogether if its slow part has so much of the variance.
_ALL_SLOW = 0.8


def lacks(diagnosis: Diagnosis) -> str:
    """The effects that were found, what else they could be, and how much they leave, in one sentence."""
    steps = kept_steps(diagnosis.steps)
    if is_of_labels(diagnosis):
        seems = f"Not the model but the set seems to be wrong: {odd_words(diagnosis)}"
        return f"{seems}. Put their labels right, or leave them out."
    if diagnosis.verdict is Verdict.DATA:
        faults = [_named(fault) for fault in diagnosis.fault.all] if diagnosis.fault is not None else []
        faults += [_of_step(step, diagnosis) for step in steps]
        return f"{_but(diagnosis)}Not the model but the set seems to be wrong: {listed(faults)}."
    if len(steps) == 1 and len(steps[0].effects) > 1:
        names = f"{listed(steps[0].effects, 'or')}: {_undecided(steps[0])}"
    else:
        names = listed([_with_rivals(step) for step in steps])
    much_left = diagnosis.left and diagnosis.error_after > MUCH * diagnosis.floor
    doubt = " With so much left, some of them may stand for others that they look like." if much_left else ""
    return f"{_but(diagnosis)}The model lacks {names}.{doubt if len(steps) >= _MANY else ''}{_doubts(diagnosis)}"


def _doubts(diagnosis: Diagnosis) -> str:
    """Which of the effects found may be no effects but the form of the largest; empty if none."""
    if not (doubted := diagnosis.doubted):
        return ""
    shares = diagnosis.shares()
    largest, they = max(shares, key=lambda name: shares[name]), "it explains" if len(doubted) == 1 else "they explain"
    return (
        f" But {listed(doubted)} may not be there: beside {largest} {they} little, and not all that is left, and may"
        f" stand for another form of {largest} than the catalogue's."
    )


def stopped_words(diagnosis: Diagnosis) -> str:
    """That a search was cut short, and what that means; empty if it was not."""
    if not diagnosis.stopped:
        return ""
    named = diagnosis.verdict.names_effects or diagnosis.fault is not None
    found = "what is named here was found by then" if named else "nothing was found by then"
    told = f"The search did not end, for {diagnosis.stopped}: {found}, and not all effects were tried."
    return " ".join(filter(None, (told, _leads_words(diagnosis, "What else" if named else "What"))))


def _leads_words(diagnosis: Diagnosis, what: str) -> str:
    """What promised most when a search was cut short; empty if nothing did."""
    part = diagnosis.target.part
    leads = [
        f"{lead.effect} (error of {lead.grasps} {part}s {lead.error_before:.2f} → {lead.error_after:.2f} × noise)"
        for lead in diagnosis.leads
    ]
    return f"{what} promised most by then, but may not be there, is {listed(leads)}." if leads else ""


def left_out_words(diagnosis: Diagnosis) -> str:
    """Which grasps the diagnosis does not speak of, and why; empty if it speaks of all."""
    if not diagnosis.left_out:
        return ""
    under = "× noise under the model that was found"
    named = listed([f"grasp {g.name} of {g.object} ({g.error:.1f} {under})" for g in diagnosis.left_out])
    left_out, one = f"Left out: {named}, {why_left_out(diagnosis)}", len(diagnosis.left_out) == 1
    if foretells_left_out(diagnosis):
        them = "it" if one else "them"
        return f"{left_out}. What was then found in those alone foretells {them} as well as the others."
    each = "It" if one else "Each"
    return (
        f"{left_out}; what is said here is of the others alone."
        f" {each} went wrong, or shook in a way that no fit can follow."
    )


def why_left_out(diagnosis: Diagnosis) -> str:
    """Of grasps that were left out, in a relative clause."""
    misses = "at first missed" if foretells_left_out(diagnosis) else "misses"
    return f"which the model {misses} far more than all others"


def foretells_left_out(diagnosis: Diagnosis) -> bool:
    """Whether the model that was found misses the grasps that were left out about as little as the others."""
    return all(grasp.error <= MUCH * diagnosis.error_after for grasp in diagnosis.left_out)


def is_of_labels(diagnosis: Diagnosis) -> bool:
    """Whether grasps have the labels of others, so that nothing else was looked for."""
    return diagnosis.verdict is Verdict.DATA and not kept_steps(diagnosis.steps) and diagnosis.fault is None


def odd_words(diagnosis: Diagnosis) -> str:
    """Grasps that a fit of all others misses by far, in words; empty if there are none."""
    if not diagnosis.odd:
        return ""
    named = listed([str(grasp) for grasp in diagnosis.odd])
    as_other = " fit as grasps of another object" if all(g.like for g in diagnosis.odd) else " fit no object of the set"
    return f"{named}{as_other}, judged by a fit of all others"


def is_only_moved(diagnosis: Diagnosis) -> bool:
    """Whether nothing is wrong with the set: what it gives was moved within its tolerance."""
    fault = diagnosis.fault
    return fault is not None and fault.moved is not None and fault.name not in diagnosis.effects


def fault_words(diagnosis: Diagnosis) -> str:
    """What seems to be wrong with the set besides what the model lacks, or in place of it; empty if nothing."""
    if diagnosis.fault is None or diagnosis.verdict is Verdict.DATA:
        return ""
    named = listed([_named(fault) for fault in diagnosis.fault.all])
    if is_only_moved(diagnosis) and diagnosis.fault.moved is not None:
        moved = f"What the set gives was moved {diagnosis.fault.moved.how}: {diagnosis.fault.words}"
        if smaller := diagnosis.fault.moved.smaller_m:
            moved += f" (objects are {1e3 * smaller:.2g} mm smaller on average so, as backlash would have them look)"
        if diagnosis.error_moved is None:
            return f"{moved}; as given the error is {diagnosis.error_before:.2f} × noise."
        if diagnosis.error_moved > _SHOWS * diagnosis.error_before:
            return f"{moved}. That shows only beside what the model lacks."
        change = f"from {diagnosis.error_before:.2f} to {diagnosis.error_moved:.2f} × noise"
        return f"{moved}. That alone takes the error {change}."
    if diagnosis.fault_is_rival:
        not_there = f"there is no {diagnosis.fault.instead_of}" if diagnosis.fault.instead_of else "nothing is missing"
        return f"Or the set is wrong, and {not_there}: {named}; these data can't tell which."
    return f"The set seems to be wrong: {named}. What follows is of the set with that put right."


def _named(fault: Fault) -> str:
    return f"{fault.name} ({fault.words}; to check: {fault.check})"


def _of_step(step: Step, diagnosis: Diagnosis) -> str:
    effect = effect_of(step.effects[0], diagnosis.target.gripper)
    return f"{effect.name} ({effect.symptom}; to check: {effect.separates})"


def row_sentence(diagnosis: Diagnosis) -> str:
    """Delays of whole rows, which the set itself may have; empty if there are none, or the answer says so."""
    step, whole = row_s(diagnosis), []
    for effect, parameters in found_parameters(diagnosis).items():
        rows = parameters["delay_s"].value / step if "delay_s" in parameters else 0.0
        if diagnosis.fault is not None and diagnosis.fault.instead_of == effect:
            continue
        if round(rows) and abs(rows - round(rows)) < _WHOLE:
            whole.append(f"{effect} is {counted(round(rows), 'row')} of the set")
    if not whole:
        return ""
    return (
        f"{listed(whole)}: is each column written in the row in which it was read or commanded? A log may be late, too"
    )


def shares_sentence(diagnosis: Diagnosis) -> str:
    """How much of the error each effect explains, and how much is left, and where; empty if none was fitted."""
    shares = diagnosis.shares()
    if not shares:
        return ""
    (first, share), *others = shares.items()
    parts = [f"{first} explains {percent(share)}", *(f"{name} {percent(share)}" for name, share in others)]
    left = percent(left_share(diagnosis))
    rest = f"{left} is left, {place_of_rest(diagnosis)}" if diagnosis.left else "no more than noise is left"
    return f"Of the error beyond the noise (mean square) {', '.join(parts)}; {rest}."


def left_share(diagnosis: Diagnosis) -> float:
    """Share of the held-out mean square beyond the noise that no effect of the final model explains."""
    return max(0.0, 1 - sum(diagnosis.shares().values()))


def percent(share: float) -> str:
    """A share in words; what is not quite nothing, or not quite all, is not rounded to it."""
    if 0 < share < 0.005:
        return "under 1%"
    return "over 99%" if 0.995 <= share < 0.9995 else f"{share:.0%}"


def place_of_rest(diagnosis: Diagnosis) -> str:
    """The phase that has most of what is left beyond the noise."""
    held, phase = diagnosis.heldout(), diagnosis.target.phase
    held = held if np.isfinite(held).any() else diagnosis.fit.residual
    beyond = [float(np.nansum(held[phase == index] ** 2 - 1)) for index in range(len(diagnosis.target.phases))]
    most = int(np.argmax(beyond))
    nearly_all = beyond[most] > _NEARLY_ALL * sum(max(0.0, one) for one in beyond)
    return f"{'' if nearly_all else 'most of it '}in {words(diagnosis.target.phases[most])}"


def _with_rivals(step: Step) -> str:
    first, *rivals = step.effects
    return f"{first} (or {listed(rivals, 'or')}: {_undecided(step)})" if rivals else first


def _undecided(step: Step) -> str:
    return f"these data can't tell which, and {step.effects[0]} is preferred, for {preference(step)}"


def preference(step: Step) -> str:
    """Why the first of the effects that can't be told apart is preferred; empty if there is one only."""
    if len(step.effects) < 2:
        return ""
    tied = step.candidates[: len(step.effects)]
    first, *others = (len(candidate.effect.parameters) for candidate in tied)
    if all(first < other for other in others):
        return "it has fewer parameters"
    if tied[0].heldout_gain < max(candidate.heldout_gain for candidate in tied):
        return "it fits all grasps better"
    if all(first == other for other in others):
        return "its held-out gain is larger"
    return "it has fewer parameters or a larger held-out gain"


def is_not_all(diagnosis: Diagnosis) -> bool:
    """Whether the effects that were found leave so much that more must be missing."""
    d = diagnosis
    return bool(d.left) and (d.error_after > _MORE * d.floor or d.explained < EXPLAINED_FAR)


def besides(diagnosis: Diagnosis) -> Candidate | None:
    """An effect that may be there besides those that were found, where much is left."""
    found = diagnosis.verdict.names_effects and is_not_all(diagnosis)
    return may_be_besides(diagnosis.steps) if found else None


def besides_sentence(diagnosis: Diagnosis) -> str:
    """What may be there besides, and why it is not among what was found; empty if there is nothing."""
    more = besides(diagnosis)
    if more is None:
        return ""
    return (
        f"{more.effect.name} may be there besides: it takes the held-out error to {more.error_after:.2f} × noise,"
        f" {percent(more.share)} of the mean square that is left beyond it. That is little, and something that is not"
        " in the catalogue might look like it"
    )


def _but(diagnosis: Diagnosis) -> str:
    d = diagnosis
    if not is_not_all(d):
        return ""
    begins, ends = "Not", ""
    if foretells_no_better(d):
        begins, ends = "Perhaps not", ", which the model with what was found may not foretell any better"
    return (
        f"{begins} all is found: {d.error_after:.2f} × the sensor noise is left on"
        f" held-out {d.target.part}s where {d.floor:.2f} would be noise ({percent(d.explained)} of the mean square"
        f" beyond it is explained){ends}. "
    )


def foretells_no_better(diagnosis: Diagnosis) -> bool:
    """Whether something is left, but no more than what the final model can't tell itself."""
    return bool(diagnosis.left) and diagnosis.error_after <= diagnosis.floor_of_model


def left_sentence(diagnosis: Diagnosis) -> str:
    """Where the rest of the error is, in words."""
    rest = where(diagnosis)
    place = f"{words(rest['signal'])}, {words(rest['phase'])}: {rest['ratio']:.1f} × noise"
    if not diagnosis.left:
        return f"what is left is noise; it is largest in {place}"
    if diagnosis.is_uneven_noise:
        of_what = "noise that grows with speed or force is so, and so are readings at uneven times"
        if diagnosis.clock_jitter is None:
            of_what += "; to tell, log the same motion twice"
        return (
            f"what is left is largest in {place}; it is white in time and nothing foretells it, though larger in some"
            f" states than in others: {of_what}"
        )
    name, share = next(iter(rest["explained_by"].items()))
    goes = f", of which {share:.0%} goes with {covariate_words(name)}" if share > 0.05 else ""
    no_better = (
        f"; {diagnosis.floor_of_model:.2f} × is the floor of the model with what was found: half its physics step"
        " changes what it foretells by so much, as where a finger slips, or a drive switches, a moment early or late"
    )
    sentence = (
        f"what is left is largest in {place}{goes}; a better model could explain {rest['explainable']:.0%} of the"
        f" remaining mean square error at most{no_better if foretells_no_better(diagnosis) else ''}"
    )
    return f"{sentence}{_forms_words(diagnosis)}" if diagnosis.may_be_forms else sentence


def jitter_sentence(diagnosis: Diagnosis) -> str:
    """By how much rows are read off their time stamps, and what to do about it; empty if that is not seen."""
    jitter = diagnosis.clock_jitter
    if jitter is None:
        return ""
    return (
        f"rows are read {1e3 * jitter.std_s:.2g} ms earlier or later than their time stamps say (standard deviation),"
        f" which makes {jitter.share:.0%} of what positions leave beyond their noise: stamp a row when it is read"
    )


def _forms_words(diagnosis: Diagnosis) -> str:
    """Why no other effect is named: what is left may be the forms of those that were found."""
    what, act = ("this effect does", "it acts") if len(diagnosis.preferred) == 1 else ("these effects do", "they act")
    return (
        f". That is within {FORM_TOLERANCE:.0%} of what {what}, and may be that {act} in another form than the"
        " catalogue's; no other effect was found that explains all of it"
    )


def recordings_sentence(diagnosis: Diagnosis) -> str:
    """The error of each of a servo's recordings that was held out, with the base model and the final one; the worst
    first. Empty where there is one at most."""
    d = diagnosis
    after = rms_of_recordings(d.heldout(), d.target) if d.target.recordings else {}
    if len(after) < 2:
        return ""
    before = rms_of_recordings(heldout_residual(d.base.fit, d.target, d.folds), d.target)
    worst = sorted(after, key=lambda name: -after[name])
    return f"held out, × noise: {', '.join(f'{name} {before[name]:.1f} → {after[name]:.1f}' for name in worst)}"


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
    slow = [k for k in range(len(names)) if noise.memory[k] > 0]
    shape = "white in time"
    if slow:
        part = "in part " if min(noise.slow_share[slow]) < _ALL_SLOW else ""
        shape = f"{part}slow, as behind a filter ({', '.join(words(names[k]) for k in slow)}), foretold by nothing"
    other = f"is not what was {source}: {sizes}"
    if noise.has_tails_alone:
        which = listed([words(names[k]) for k in range(len(names)) if noise.affected[k]])
        other = f"of {which} has heavy tails, and the size that was {source}"
    no_effect = f"The residuals are {shape} and alike in all phases, which no missing effect makes."
    # rows that are read off their time stamps make it seem larger: what to do about them is told by itself
    to_do = "" if noise.has_tails_alone or diagnosis.clock_jitter is not None else f" To do: {again}."
    return f"But the noise {other}. {no_effect}{to_do}"


def _scatter(what: str, ratio: float, heavy: bool) -> str:
    return f"{what} scatter by {ratio:.2g} ×" + (" (with heavy tails)" if heavy else "")
