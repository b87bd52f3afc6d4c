"""Zeros that change within a set, or differ from session to session, and gains that drift."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from forcegrasp.diagnosis.faults.fault import ANY, Fault, with_each
from forcegrasp.diagnosis.faults.linear_step import linear_step, one_of_each
from forcegrasp.diagnosis.faults.session_drift import order_in_session, session_drift
from forcegrasp.diagnosis.faults.session_zeros import SessionZeros, session_zeros
from forcegrasp.diagnosis.faults.shifted_rows import left_beyond_noise
from forcegrasp.diagnosis.signatures import Background
from forcegrasp.diagnosis.verdict import LEAST_SHARE
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.target import Target
from forcegrasp.measure.check_givens import Tare, find_odd_zeros, find_tare
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet

# What a linear step makes of a change of zero is believed if it differs by no more than this share.
_OTHERWISE = 0.2


def wrong_zeros(loaded: Loaded[MeasurementSet], target: Target, fit: Fit) -> list[Fault]:
    """Zeros or gains that change; of forces what leaves least, zeros of each session only if they leave much less."""
    zeros, (of_forces, left) = session_zeros(target, fit), _of_forces(loaded, target, fit)
    if zeros is None:
        return of_forces
    told = differing(loaded, zeros)
    if zeros.of != "forces":
        return [*of_forces, told]
    before = left_beyond_noise(fit.residual, Background(fit, ()), target)
    return [told] if left - zeros.left > LEAST_SHARE * before else of_forces


def differing(loaded: Loaded[MeasurementSet], zeros: SessionZeros) -> Fault:
    """Encoders or force sensors that have another zero in each session of a set."""
    columns = loaded.measured.columns
    words = zeros.words(columns.force if zeros.of == "forces" else columns.position, columns.unit)
    right = with_each(loaded, lambda _, g: zeros.taken_out(g))
    return Fault(zeros.name, words, zeros.check, right, worth=LEAST_SHARE)


def _of_forces(loaded: Loaded[MeasurementSet], target: Target, fit: Fit) -> tuple[list[Fault], float]:
    """Zeros or gains of forces that change, and the sum of squares beyond the noise that what is told leaves."""
    measured = loaded.measured
    tare, drift, left = find_tare(measured), session_drift(target, fit), np.inf
    if tare is not None:
        tare, left = _sharper(tare, target, fit)
    if tare is not None and (drift is None or left <= drift.left):
        words = f"the zero changes at grasp {measured.grasps[tare.first].name}: {tare.words(measured)}"
        return [_tared(loaded, [tare], words, "whether sensors were set to zero there")], left
    if drift is not None:
        order = order_in_session(measured.grasps)
        check = "whether sensors or motors warm up meanwhile: grasp one object first and last, and compare"
        right = with_each(loaded, lambda index, g: drift.taken_out(g, order[index]))
        words = drift.words(measured.columns.force)
        return [Fault(f"force_{drift.of}_drift", words, check, right, worth=LEAST_SHARE)], drift.left
    if odd := [_sharper(one, target, fit)[0] for one in find_odd_zeros(measured)]:
        each = [f"grasp {measured.grasps[one.first].name} ({one.words(measured)})" for one in odd]
        words = f"forces have another zero in {listed(each)} alone"
        return [_tared(loaded, odd, words, "whether sensors were set to zero there while something was held")], np.inf
    return [], np.inf


def _sharper(tare: Tare, target: Target, fit: Fit) -> tuple[Tare, float]:
    """The same change as all readings have it, by a linear step from a fit; as it was where these say otherwise.

    Readings before contact, which show that a zero has changed, are few. Also what the step leaves beyond the noise.
    """
    changed = np.flatnonzero(tare.change_n)
    per_unit = one_of_each(target, target.axis.forces)[..., changed]
    per_unit[: tare.first] = per_unit[tare.end :] = 0.0
    step, left = linear_step(target, fit, Background(fit, ()), per_unit)
    change = tare.change_n.copy()
    change[changed] = np.where(
        np.abs(step - change[changed]) < _OTHERWISE * np.abs(change[changed]), step, change[changed]
    )
    return dataclasses.replace(tare, change_n=change), left


def _tared(loaded: Loaded[MeasurementSet], tares: Sequence[Tare], words: str, check: str) -> Fault:
    """Zeros that are others in some grasps, and the set with the usual ones there."""

    def levelled(index: int, grasp: MeasuredGrasp) -> MeasuredGrasp:
        changes = [tare.change_n for tare in tares if tare.first <= index < tare.end]
        return dataclasses.replace(grasp, force_n=grasp.force_n - sum(changes)) if changes else grasp

    return Fault("force_tare", words, check, with_each(loaded, levelled), worth=ANY)
