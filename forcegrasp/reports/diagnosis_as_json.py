"""A diagnosis in plain types."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from forcegrasp.diagnosis.advice import Advice
from forcegrasp.diagnosis.faults.fault import Fault
from forcegrasp.diagnosis.result import NOTHING, Diagnosis, Step
from forcegrasp.effects import Effect
from forcegrasp.reports.diagnosis_answer import answer
from forcegrasp.reports.diagnosis_words import left_share, preference
from forcegrasp.reports.findings import (
    candidate_json,
    final_warnings,
    found_parameters,
    no_trace,
    noise_json,
    ranking,
    where,
)
from forcegrasp.reports.law import law_json


def diagnosis_json(diagnosis: Diagnosis, advice: Advice | None, tried: Sequence[type[Effect]], name: str) -> dict:
    """The diagnosis in plain types."""
    return {
        "set": name,
        "answer": answer(diagnosis),
        "verdict": diagnosis.verdict,
        "stopped": diagnosis.stopped,
        "leads": [dataclasses.asdict(lead) for lead in diagnosis.leads],
        "effects": list(diagnosis.effects),
        "preferred": list(diagnosis.preferred),
        "explained_share": diagnosis.explained,
        "shares": diagnosis.shares(),
        "left_share": left_share(diagnosis) if diagnosis.shares() else None,
        "doubted": list(diagnosis.doubted),
        "fault": _fault_json(diagnosis.fault),
        "law": law_json(diagnosis.law),
        "odd_grasps": [dataclasses.asdict(grasp) for grasp in diagnosis.odd],
        "left_out": [dataclasses.asdict(grasp) for grasp in diagnosis.left_out],
        "alone": diagnosis.alone,
        "may_be_forms": diagnosis.may_be_forms,
        "uneven_noise": diagnosis.is_uneven_noise,
        "clock_jitter": None if diagnosis.clock_jitter is None else dataclasses.asdict(diagnosis.clock_jitter),
        "steps": [_step_json(step, diagnosis) for step in diagnosis.steps],
        "ranking": ranking(diagnosis),
        "no_trace": no_trace(diagnosis, tried),
        "parameters": {
            effect: {name: dataclasses.asdict(fitted) for name, fitted in found.items()}
            for effect, found in found_parameters(diagnosis).items()
        },
        "error_before": diagnosis.error_before,
        "error_moved": diagnosis.error_moved,
        "error_after": diagnosis.error_after,
        "floor_ratio": diagnosis.error_after,
        "floor": diagnosis.floor,
        "floor_of_model": diagnosis.floor_of_model,
        "next_grasp": None if advice is None else {
            **advice.next_grasp.model_dump(),
            "tells_apart": list(advice.rivals),
            "differences": dict(advice.differences),
            "bits": advice.bits[advice.grasp],
        },
        "where": where(diagnosis),
        "reason": diagnosis.base.reason,
        "noise_given": diagnosis.target.sigma_known,
        "noise": noise_json(diagnosis),
        "warnings": final_warnings(diagnosis),
    }  # fmt: skip


def _fault_json(fault: Fault | None) -> dict[str, Any] | None:
    if fault is None:
        return None
    then = _fault_json(fault.then)
    return {"name": fault.name, "words": fault.words, "check": fault.check, "moved": fault.moved_by, "then": then}


def _step_json(step: Step, diagnosis: Diagnosis) -> dict[str, Any]:
    return {
        "verdict": step.verdict or NOTHING,
        "effects": list(step.effects),
        "preferred_because": preference(step),
        "error_before": step.error_before,
        "error_after": step.error_after,
        "ranking": [candidate_json(c, diagnosis) for c in step.candidates],
    }
