"""The verdict of a diagnosis in words."""

from __future__ import annotations

from forcegrasp.diagnosis.result import Diagnosis
from forcegrasp.identify.cross_validation import rms
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.noise_floor import AT_FLOOR
from forcegrasp.identify.verdict import Verdict
from forcegrasp.reports.comparison import words, worst_cell
from forcegrasp.reports.diagnosis_words import (
    fault_words,
    is_of_labels,
    is_only_moved,
    lacks,
    left_out_words,
    noise_words,
    shares_sentence,
    stopped_words,
)
from forcegrasp.reports.findings import remaining
from forcegrasp.reports.fit import ADVICE
from forcegrasp.reports.physics_step import shorter_step


def answer(diagnosis: Diagnosis) -> str:
    """The verdict in words."""
    of_model, of_set = _of_model(diagnosis), fault_words(diagnosis)
    alone = f"Only {diagnosis.alone} shows more: look at it." if diagnosis.alone else ""
    # what was moved within its tolerance is no fault, and comes after the verdict
    model_first = diagnosis.fault_is_rival or is_only_moved(diagnosis)
    parts = (of_model, of_set) if model_first else (of_set, of_model)
    return " ".join(filter(None, (stopped_words(diagnosis), *parts, alone, left_out_words(diagnosis))))


def _missed_objects(d: Diagnosis) -> str:
    """Why held-out error is left though nothing is missing; empty if none is."""
    fitted = rms(d.fit.residual, d.target)
    if d.left or d.noise is not None or d.error_after < AT_FLOOR * max(d.floor, fitted):
        return ""
    return (
        f" A fit of all {d.target.part}s leaves {fitted:.2f} ×: where few are left to fit an"
        " object by, those held out are missed."
    )


def _of_model(diagnosis: Diagnosis) -> str:
    d, cell, noise = diagnosis, worst_cell(remaining(diagnosis).cells()), noise_words(diagnosis)
    found = listed([*(d.fault.names if d.verdict is Verdict.DATA and d.fault else []), *d.preferred] or [""])
    place = f"{words(cell.signal)}, {words(cell.phase)} ({cell.ratio:.1f} × noise)"
    if is_of_labels(d):
        return lacks(d)
    if d.verdict.names_effects:
        change = f"from {d.error_of_base:.2f} to {d.error_after:.2f} ×"
        with_found = f"{found} put right" if d.verdict is Verdict.DATA else found
        fall = f"With {with_found} the error on held-out {d.target.part}s falls {change}"
        rest = f"What is left is largest in {place}." if d.left else noise
        told = " ".join(filter(None, (lacks(d), shares_sentence(d))))
        return f"{told} {fall} the sensor noise; up to {d.floor:.2f} is noise. {rest}".rstrip() + _missed_objects(d)
    if d.verdict is Verdict.EXPLAINED:
        of_noise = f"the error on held-out {d.target.part}s is {d.error_after:.2f} × the sensor noise"
        if noise:
            return f"The model explains these data: they show no missing effect; {of_noise}. {noise}"
        return (
            f"The model explains these data: {of_noise}, and up to {d.floor:.2f} is noise and the simulation's own"
            f" error. They show no missing effect.{_missed_objects(d)}"
        )
    if d.verdict is Verdict.UNKNOWN:
        best = f"{found} would only take it down to {d.error_after:.2f} ×" if found else "no effect explains it"
        if d.stopped and not found:
            best = f"up to {d.floor:.2f} is noise"
        missing = "Something is missing, and it is none of the effects I know"
        if d.stopped:
            missing = "Something is missing"
        if d.is_uneven_noise:
            missing += ", or the noise grows with speed or force"
        if shorter_step(d) is not None:
            missing += ", as far as the scene's physics step lets me tell"
        return (
            f"{missing}: the error on held-out {d.target.part}s is"
            f" {d.error_of_base:.2f} × the sensor noise, and {best}. Look at {place}."
        )
    return f"No diagnosis, for the base model is not fitted: {d.base.reason}. To do: {ADVICE}."
