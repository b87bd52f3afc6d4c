"""No object prints its arrays: a repr is a line, and says of a result what a user wants to know."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import forcegrasp as fg
from forcegrasp.api import AddResult, CompareResult, DiagnoseResult, FitResult, TableResult
from forcegrasp.measure import read_set
from forcegrasp.physics import GraspParameters, default_gripper
from forcegrasp.replay.plans import make_plan
from forcegrasp.replay.record import Recorded
from forcegrasp.short_repr import LONGEST, ShortRepr, cut, some


@pytest.fixture
def results(made_up, table) -> SimpleNamespace:
    """One result of each kind."""
    data, model = made_up.loaded, made_up.model
    diagnosis = made_up.diagnosis("effect")
    return SimpleNamespace(
        compare=CompareResult(data, made_up.comparison, model, "", ("a note",)),
        fit=FitResult(data, made_up.target, made_up.base, model, None),
        diagnose=DiagnoseResult(data, diagnosis, made_up.advice, tuple(made_up.tried), (), False),
        one_of=DiagnoseResult(data, made_up.diagnosis("one_of"), None, tuple(made_up.tried), (), True),
        not_fitted=DiagnoseResult(data, made_up.diagnosis("not_fitted"), None, (), (), True),
        add=AddResult(data, made_up.added, made_up.tried[0], Path("x.yaml")),
        table=fg.compare(table),
        recorded=Recorded(data.measured, {"radius_m": np.zeros(8)}),
        parameters=GraspParameters.from_array(np.ones((1000, 5))),
        plan=make_plan("rich", np.array([0.02]), 2, default_gripper(), np.random.default_rng(0)),
        final_forces=read_set(table),
    )


def inside(thing: object, seen: set[int]) -> Iterator[object]:
    """An object and all that can be reached from it."""
    if id(thing) in seen:
        return
    seen.add(id(thing))
    if dataclasses.is_dataclass(thing) and not isinstance(thing, type):
        yield thing
        for field in dataclasses.fields(thing):
            yield from inside(getattr(thing, field.name), seen)
    elif isinstance(thing, (list, tuple)):
        for part in thing:
            yield from inside(part, seen)
    elif isinstance(thing, (dict, SimpleNamespace)):
        for part in (thing if isinstance(thing, dict) else vars(thing)).values():
            yield from inside(part, seen)


def test_every_repr_is_a_line(results):
    found = list(inside(results, set()))
    assert {type(r).__name__ for r in found} >= {
        "CompareResult", "FitResult", "DiagnoseResult", "AddResult", "TableResult", "Loaded", "MeasurementSet",
        "MeasuredGrasp", "FinalForceTable", "Model", "FoundEffect", "Gripper", "Comparison", "Diagnosis", "Step",
        "Candidate", "Fit", "BaseFit", "Target", "Added", "Advice", "Score", "TableAnalysis", "Recorded",
        "GraspParameters", "PlannedGrasp",
    }  # fmt: skip
    for one in found:
        assert len(repr(one)) <= LONGEST, repr(one)
        assert repr(one).isprintable(), repr(one)
        assert "..." not in repr(one), "an array that numpy shortened"


def test_results_say_what_a_user_wants_to_know(results):
    name = r"<script>alert\(1\)</script> .*"
    told = {
        "compare": rf"CompareResult\({name}: error \d\.\d\d × noise, a perfect model 1\.02;"
        r" largest in hold, force_l: \d\.\d × noise\)",
        "fit": rf"FitResult\({name}: converged; error \d\.\d\d × noise, \d+ parameters, \d+ warnings?\)",
        "diagnose": rf"DiagnoseResult\({name}: effect force_bias; error \d\.\d\d → 1\.\d\d × noise, floor 1\.02\)",
        "one_of": rf"DiagnoseResult\({name}: one_of force_bias, force_drift; error .*\)",
        "not_fitted": rf"DiagnoseResult\({name}: not_fitted; error .*\)",
        "add": rf"AddResult\({name}: force_bias added; error \d\.\d\d → 1\.00 × noise\)",
        "table": r"TableResult\(table: one_of \w+, \w+, \w+ and \d+ more\)",
    }
    for kind, pattern in told.items():
        assert re.fullmatch(pattern, repr(getattr(results, kind))), repr(getattr(results, kind))
    assert isinstance(results.table, TableResult)
    assert repr(results.final_forces) == "FinalForceTable(table: 10 squeezes of 1 object, gripper tiago)"
    assert repr(results.fit.data).endswith("8 grasps of 2 objects, gripper tiago; 1 warning)")
    assert repr(results.fit.data.measured.grasps[1]) == "MeasuredGrasp(g1 on thing 1, 150 samples)"
    assert repr(results.fit.model.gripper) == "Gripper(tiago, 6 parameters)"
    assert "effects: force_bias; " in repr(results.add.model)
    assert repr(results.parameters).startswith("GraspParameters(kappa=array(1000,), b2=array(1000,)")


def test_a_fit_that_is_not_to_be_believed_says_so(made_up):
    result = FitResult(made_up.loaded, made_up.target, made_up.diagnosis("not_fitted").base, made_up.model, None)
    assert "NOT fitted, the starts differ;" in repr(result)


@dataclasses.dataclass(repr=False)
class Long(ShortRepr):
    """Whatever is in a field."""

    text: str = "line\nline " * 100
    many: tuple = tuple(range(1000))
    few: tuple = (0.123456789, np.zeros((2, 3)), int)


def test_what_is_long_is_cut():
    assert len(repr(Long())) < 150
    assert repr(Long("a", ())) == "Long(text='a', many=[], few=[0.1235, array(2, 3), int])"
    assert "many=tuple of 1000" in repr(Long())
    assert cut("a\n\tb" + 100 * "x", 10) == "a bxxxxxx…"
    assert some(["a", "b"]) == "a, b"
    assert some("abcdef") == "a, b, c and 3 more"
