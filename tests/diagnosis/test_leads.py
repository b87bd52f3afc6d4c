"""What promised most when a search was cut short."""

from __future__ import annotations

import dataclasses
import importlib
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from forcegrasp.diagnosis.leads import Leads
from forcegrasp.diagnosis.search.refine import refine_anyway
from forcegrasp.diagnosis.search.search import diagnose
from forcegrasp.diagnosis.study import Few, Study
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.identify.verdict import Verdict
from forcegrasp.reports.diagnosis_answer import answer
from forcegrasp.reports.diagnosis_as_json import diagnosis_json
from forcegrasp.reports.next_step import after_diagnosis
from tests.diagnosis.test_exchange import rubbing as rubbing  # a fixture

REFINE = importlib.import_module("forcegrasp.diagnosis.search.refine")


def having(*effects: str) -> Any:
    """A fit with these effects."""
    return SimpleNamespace(effects=[SimpleNamespace(effect=SimpleNamespace(name=name)) for name in effects])


def take_down(leads: Leads, before: float, after: float, *effects: str, grasps: int) -> None:
    leads.add(having(*effects), having(*effects[:-1]), before, after, grasps)


def test_what_explains_most_comes_first_and_the_furthest_fit_of_each_effect_counts():
    leads = Leads()
    take_down(leads, 4, 1.0, "stiction", grasps=3)
    take_down(leads, 3, 2.0, "stiction", grasps=12)
    take_down(leads, 3, 1.8, "stiction", grasps=12)  # brought to its end
    take_down(leads, 4, 1.2, "stiction", grasps=3)
    take_down(leads, 4, 1.5, "backlash", grasps=3)
    take_down(leads, 3, 2.9, "force_lag", grasps=12)  # explains too little
    take_down(leads, 1.8, 1.0, "stiction", "force_bias", grasps=12)
    nothing, stiction = having(), having("stiction")
    best, second = leads.beside(nothing)
    assert (best.effect, best.grasps, second.effect, second.grasps) == ("backlash", 3, "stiction", 12)
    assert (second.error_before, second.error_after) == pytest.approx((3, 1.8))
    assert [one.effect for one in leads.beside(stiction)] == ["force_bias"]
    for name in ("a", "b", "c"):
        take_down(leads, 3, 1.0, name, grasps=12)
    assert len(leads.beside(nothing)) == 3


def test_a_stopped_search_tells_the_fits_that_it_had_made(rubbing, monkeypatch):
    """Not a word of them would be wasted minutes."""
    _, target, simulators, base = rubbing
    friction = effect_of("coulomb_friction", target.gripper)

    def cut_short(*arguments, **more):
        refine_anyway([friction], arguments[0], arguments[1])
        raise KeyboardInterrupt

    monkeypatch.setattr("forcegrasp.diagnosis.search.search.look_further", cut_short)
    told: list[str] = []
    found = diagnose(target, base, simulators, [friction], np.random.default_rng(0), told.append)
    (lead,) = found.leads
    assert (found.verdict, lead.effect, lead.grasps) == (Verdict.UNKNOWN, "coulomb_friction", len(target.grasps))
    assert lead.error_after < 1.2 < lead.error_before
    change = f"{lead.error_before:.2f} → {lead.error_after:.2f} × noise"
    assert f"coulomb_friction, on all grasps: {change}" in told
    words = "What promised most by then, but may not be there, is coulomb_friction"
    words += f" (error of {lead.grasps} windows {change})."
    assert words in answer(found)
    assert diagnosis_json(found, None, [], "")["leads"] == [dataclasses.asdict(lead)]
    lines = [command.line for command in after_diagnosis(found, None, "my_set", "known.yaml", "found.yaml")]
    adding = "forcegrasp add data=my_set model=known.yaml effect=coulomb_friction out=better.yaml"
    assert lines == ["forcegrasp diagnose data=my_set", adding]


def test_fits_to_few_grasps_are_told_too(rubbing):
    """Of one search, whatever grasps it looks at and however they are weighed."""
    _, target, simulators, base = rubbing
    few = Few(np.array([0, 1]), simulators, simulators.cheap)
    study = Study(target, simulators, (), few=few)
    again = dataclasses.replace(study, target=target)
    some, _ = again.on_few(base.fit)
    assert some is not again
    assert some.leads is again.leads is study.leads


def test_a_search_that_ended_has_none(made_up):
    assert made_up.diagnosis("unknown").leads == ()
    assert "promised" not in answer(dataclasses.replace(made_up.diagnosis("unknown"), stopped="its 3 min were over"))


@pytest.mark.parametrize("verdict", ["effect", "unknown"])
def test_what_was_found_is_told_apart_from_what_promised_most(made_up, verdict):
    leads = Leads()
    take_down(leads, 4, 1.5, "backlash", grasps=3)
    (lead,) = leads.beside(having())
    found = dataclasses.replace(made_up.diagnosis(verdict), stopped="its 3 min were over", leads=(lead,))
    what = "What else" if verdict == "effect" else "What"
    assert f"{what} promised most by then, but may not be there, is backlash" in answer(found)
