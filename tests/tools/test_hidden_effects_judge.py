"""What the campaign calls right."""

from __future__ import annotations

import pytest

from tools.hidden_effects_judge import false_names, families, judge, named_of


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


def test_families_are_those_of_the_catalogue() -> None:
    assert families(["stiction", "coulomb_friction", "early_row"]) == {"friction"}
