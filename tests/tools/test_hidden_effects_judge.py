"""What the campaign calls right."""

from __future__ import annotations

import ast

import pytest

from forcegrasp.diagnosis.law.law_terms import LIBRARY
from tests.independent.catalogue import OUTSIDE
from tools.hidden_effects_judge import TERMS, false_names, families, has_right_term, judge, named_of, settled


def row(group: str, verdict: str, *steps: str) -> dict:
    """A result; "a|b" is a step where a can't be told from b."""
    found = [step.split("|") for step in steps]
    return {
        "group": group, "verdict": verdict, "effects": [name for step in found for name in step],
        "steps": [[verdict, names] for names in found] + [["", []]],
    }  # fmt: skip


@pytest.mark.parametrize(
    ("group", "right", "verdict", "steps", "judged"),
    [
        ("one", "backlash", "effect", ["backlash"], "first"),
        ("one", "backlash", "one_of", ["force_lag|backlash"], "in set"),
        ("one", "backlash", "effect", ["force_lag"], "wrong"),
        ("one", "backlash", "unknown", [], "missed"),
        ("one", "backlash", "error", [], "error"),
        ("none", "", "explained", [], "first"),
        ("none", "", "effect", ["backlash"], "wrong"),
        ("noise", "", "unknown", [], "missed"),
        ("outside", "", "unknown", [], "first"),
        ("outside", "", "effect", ["backlash"], "wrong"),
        ("law", "coulomb_friction", "effect", ["stiction"], "first"),  # of one family
        ("law", "coulomb_friction", "effect", ["backlash"], "wrong"),
        ("law", "coulomb_friction", "one_of", ["backlash|stiction"], "in set"),
        ("contact", "", "effect", ["stiffening_contact"], "first"),
        ("contact", "", "effect", ["backlash"], "wrong"),
        ("contact", "backlash", "effect", ["position_deadband"], "first"),
        ("spoiled", "", "data", ["object_size"], "first"),
        ("spoiled", "", "refused", [], "first"),
        ("spoiled", "", "one_of", ["backlash|object_size"], "in set"),
        ("spoiled", "", "one_of", ["backlash|early_row"], "in set"),
        ("spoiled", "", "effect", ["backlash"], "wrong"),
        ("spoiled", "", "unknown", [], "missed"),
        ("several", "backlash force_lag", "effect", ["force_lag", "backlash"], "first"),
        ("several", "backlash force_lag", "effect", ["force_lag", "backlash", "adhesion"], "in set"),
        ("several", "backlash force_lag", "effect", ["force_lag"], "in set"),
        ("several", "backlash force_lag", "effect", ["adhesion"], "wrong"),
        ("several", "backlash force_lag", "unknown", [], "missed"),
        ("messy", "", "effect", ["encoder_bias"], "first"),
        ("messy", "", "effect", ["encoder_bias", "adhesion"], "in set"),
        ("messy", "backlash", "effect", ["encoder_bias", "backlash|adhesion"], "first"),
    ],
)
def test_judgements(group: str, right: str, verdict: str, steps: list[str], judged: str) -> None:
    assert judge(row(group, verdict, *steps), set(right.split())) == judged


def test_what_is_named_and_what_is_named_falsely() -> None:
    found, right = (
        row("several", "effect", "force_lag|force_delay", "adhesion", "backlash"),
        {"force_delay", "backlash"},
    )
    assert named_of(found, right) == right
    assert false_names(found, right) == ["adhesion"]
    assert false_names({**found, "group": "messy"}, right) == ["adhesion"]
    assert false_names({**row("messy", "effect", "encoder_bias"), "group": "several"}, right) == ["encoder_bias"]


def test_mistakes_of_a_set_are_named_by_the_fault() -> None:
    right = {"time_scale", "swapped_forces"}
    one = {**row("two mistakes", "data", "swapped_forces"), "faults": ["force_tare"]}
    assert (judge(one, right), named_of(one, right)) == ("in set", {"swapped_forces"})
    both = {**one, "faults": ["time_scale"]}
    assert (judge(both, right), named_of(both, right), false_names(both, right)) == ("first", right, [])
    assert judge(row("two mistakes", "effect", "backlash"), right) == "wrong"
    assert judge(row("two mistakes", "unknown"), right) == "missed"


def test_families_are_those_of_the_catalogue() -> None:
    assert families(["stiction", "coulomb_friction", "early_row"]) == {"friction"}


def test_a_tie_is_settled_where_the_right_effect_is_left_alone() -> None:
    def tie(*last: tuple[str, list[str]], named: str = "force_lag|force_delay") -> dict:
        further = [{"grasp": "fast step", "verdict": verdict, "effects": effects} for verdict, effects in last]
        return row("tie", "one_of", named) | {"further": {"proposed": further, "chance": []}}

    right, still = {"force_delay"}, ("one_of", ["force_delay", "force_lag"])
    assert settled(tie(still, ("effect", ["force_delay"])), right, "proposed") is True
    assert settled(tie(("effect", ["force_lag"])), right, "proposed") is False
    assert settled(tie(("effect", ["force_delay", "backlash"])), right, "proposed") is False
    assert settled(tie(still, still), right, "proposed") is False
    assert settled(tie(still), right, "chance") is False  # no grasp was proposed
    assert settled(tie(still, named="backlash|adhesion"), right, "proposed") is None  # no right tie
    assert settled(row("tie", "effect", "force_delay"), right, "proposed") is None
    assert settled(row("one", "one_of", "force_lag|force_delay"), right, "proposed") is None


def test_a_law_is_right_if_it_has_the_term_of_what_was_hidden() -> None:
    def outside(hidden: str, law: dict | None) -> dict:
        return row("outside", "unknown") | {"hidden": [hidden], "law": law}

    bent = {"place": "force", "expression": "c1 * force * abs(force) + c2 * time", "share": 0.9}
    assert has_right_term(outside("curved_force_gain", bent)) is True
    assert has_right_term(outside("curved_force_gain", bent | {"place": "motor"})) is False
    assert has_right_term(outside("tip_inertia", bent)) is False
    assert has_right_term(outside("tip_inertia", None)) is False
    wave = {"place": "motor", "expression": "c1 * sin(6.28319 * position / period1 + phase1 + apart1 * side)"}
    assert has_right_term(outside("motor_cogging", wave)) is True
    assert has_right_term(outside("eccentric_encoder", wave)) is False
    assert has_right_term(outside("stale_positions", bent)) is None  # no term of the library forgets to read
    assert has_right_term(row("none", "explained") | {"hidden": [], "law": bent}) is None


def test_each_term_that_would_be_right_is_in_the_library_and_each_effect_in_the_rig() -> None:
    assert set(TERMS) <= set(OUTSIDE)
    for place, texts in TERMS.values():
        known = [t.format(e="(command - position)", v=1, side="") for t, _ in LIBRARY[place]]
        known = [ast.unparse(ast.parse(f"c1 * {term}")) for term in known]
        assert all(any(text in one for one in known) for text in texts)
