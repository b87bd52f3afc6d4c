"""Whatever a diagnosis comes to, all that tells of it can be made: words, figures, the box, the next commands."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator

import numpy as np
import pytest

from forcegrasp.diagnosis.faults.fault import Fault
from forcegrasp.diagnosis.faults.odd_grasps import OddGrasp
from forcegrasp.diagnosis.faults.tolerance import Moved
from forcegrasp.diagnosis.noise.noise_check import Noise
from forcegrasp.diagnosis.result import Diagnosis
from forcegrasp.identify.givens import Given
from forcegrasp.identify.verdict import Verdict
from forcegrasp.reports import diagnosis as report
from forcegrasp.reports import diagnosis_answer, diagnosis_as_json
from forcegrasp.reports.diagnosis_box import answer_box
from forcegrasp.reports.next_step import after_diagnosis

VERDICTS = [verdict.value for verdict in Verdict]
NOISE = Noise(np.full(4, 1.5), np.full(4, 1.5), np.ones(4, bool), np.zeros(4), np.zeros(4))
ODD = (OddGrasp("g3", "thing 1", 9.0, "thing 0", 1.1),)


def with_faults(found: Diagnosis, made_up) -> Iterator[Diagnosis]:
    """The diagnosis of a set without a fault, and of sets with one: besides, instead, or moved within a tolerance."""
    yield found
    fault = Fault("time_scale", "stamps are too long", "the clock", made_up.loaded)
    number = Given("readout_skew_s", "", 0.002, np.ones(8, bool))
    moved = dataclasses.replace(fault, name="timing_tolerance", moved=Moved((number,), np.array([-2.0])))
    yield dataclasses.replace(found, fault=moved)
    if found.verdict is Verdict.DATA:
        yield dataclasses.replace(found, effects=(fault.name,), fault=fault, steps=())
    if found.verdict in (Verdict.EFFECT, Verdict.ONE_OF, Verdict.UNKNOWN):
        effects = (fault.name, *found.effects) if found.effects else ()
        yield dataclasses.replace(found, effects=effects, fault=fault)
    if found.verdict in (Verdict.EFFECT, Verdict.ONE_OF):
        for one in (fault, moved):
            yield dataclasses.replace(
                found, verdict=Verdict.ONE_OF, effects=(*found.effects, one.name), fault=one
            )  # also where no two effects are rivals


def with_steps(found: Diagnosis) -> Iterator[Diagnosis]:
    """The diagnosis as it is, and with a second effect after which no other was found."""
    yield found
    if not found.effects:
        return
    (step,) = found.steps
    second = dataclasses.replace(step, effects=("force_drift",), candidates=step.candidates[1:], of_many=True)
    none = dataclasses.replace(step, effects=(), error_before=step.error_after)
    yield dataclasses.replace(found, effects=(*found.effects, "force_drift"), steps=(step, second, none))


@pytest.mark.parametrize(("left", "noise", "odd"), [("", None, ()), ("in all", None, ODD), ("", NOISE, ())])
@pytest.mark.parametrize("verdict", VERDICTS)
def test_all_that_tells_of_a_diagnosis_can_be_made(made_up, verdict, left, noise, odd):
    basis = dataclasses.replace(made_up.diagnosis(verdict), left=left, noise=noise, odd=odd)
    for stepped, advice in zip(with_steps(basis), (None, made_up.advice), strict=False):
        for found in with_faults(stepped, made_up):
            assert diagnosis_answer.answer(found)
            assert all(isinstance(line, str) for line in report.lines(found, advice))
            report.printed(found)
            written = diagnosis_as_json.diagnosis_json(found, advice, made_up.tried, "s")
            assert json.loads(json.dumps(written))["verdict"] == found.verdict
            commands = after_diagnosis(found, advice, "set", "base.yaml", "found.yaml")
            assert commands
            assert all(one.line.startswith("forcegrasp ") and one.purpose for one in commands)
            assert answer_box(found, advice, commands).what
