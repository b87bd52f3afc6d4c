"""A delay of whole rows may be of the log: both are named, and of other delays only the effect."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.diagnosis.faults.tolerance import all_radii
from forcegrasp.diagnosis.faults.wrong_radii import moved_as_fault
from forcegrasp.diagnosis.givens.late_rows import may_be_late_rows
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.verdict import Verdict
from forcegrasp.models.model_file import Model
from forcegrasp.reports.diagnosis_answer import answer
from forcegrasp.reports.diagnosis_words import row_sentence
from tests.light_set import light_set


def silent(text: str) -> None:
    """Takes what a diagnosis tells about its progress."""


@pytest.fixture(scope="module")
def model() -> Model:
    """The base model of the grasps, with nothing hidden in them."""
    loaded = light_set()
    target, _, base = fit_model(loaded, 0, silent)
    return model_of(base.fit, target, loaded, [])


def written_late(rows: int) -> Loaded:
    """Grasps whose forces are written so many rows late."""
    loaded = light_set()
    grasps = tuple(
        dataclasses.replace(g, force_n=np.concatenate([g.force_n[:1]] * rows + [g.force_n[:-rows]]))
        for g in loaded.measured.grasps
    )
    return dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=grasps))


@pytest.mark.long
@pytest.mark.parametrize("rows", [1, 2])
def test_forces_that_are_written_late_are_told_beside_the_delay(model, rows):
    diagnosis, _ = diagnose_set(written_late(rows), model, ["force_delay", "force_lag"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("one_of", ("force_delay", "late_row"))
    told = f"Or the set is wrong, and there is no force_delay: late_row (forces are written {rows} row"
    assert told in answer(diagnosis)
    assert row_sentence(diagnosis) == ""
    loaded = written_late(rows)
    moved = all_radii(loaded.measured, diagnosis.target, 3e-5)
    assert moved is not None
    fault = moved_as_fault(loaded, moved)
    alone = dataclasses.replace(diagnosis, verdict=Verdict.EFFECT, effects=("force_delay",), fault=fault)
    again = may_be_late_rows(alone, loaded)
    assert (again.verdict, again.effects) == ("one_of", ("force_delay", "late_row"))
    assert f"late_row (forces are written {rows} row" in answer(again)
    assert "within its tolerance, radius of thing_0 by" in answer(again)


@pytest.mark.long
@pytest.mark.parametrize(
    ("hidden", "rival"),
    [
        ("force_delay delay_s=0.06", None),
        ("readout_skew delay_s=0.04", "positions are written 1 row late"),
        ("command_delay delay_s=0.04", "commands are written 1 row early, or all readings 1 row late"),
    ],
)
def test_what_may_be_written_late_is_told_by_the_delay(model, hidden, rival):
    name = hidden.split()[0]
    diagnosis, _ = diagnose_set(light_set(hidden), model, [name], 0, silent)
    assert diagnosis.effects == ((name, "late_row") if rival else (name,))
    assert (diagnosis.fault.words if diagnosis.fault else None) == rival
