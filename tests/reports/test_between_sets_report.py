"""What several sets share, in words, tables, JSON and a figure: as it was put in."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from rich.console import Console

from forcegrasp.identify.between_sets import Between, BetweenSets, SetFit
from forcegrasp.models.model_file import Fitted
from forcegrasp.reports import between_sets as report
from forcegrasp.reports import comparison as comparison_report
from forcegrasp.reports.html import Picture, Table, write_report
from forcegrasp.reports.next_step import after_comparison
from tests.made_up import NASTY

FLOOR = 1.02


def fitted(value: float, half: float, unit: str = "") -> Fitted:
    return Fitted(value, value - half, value + half, unit)


def parameter(name: str, p: float, sets: tuple[str, ...] = ("a", "b"), **more) -> Between:
    values = {one: fitted(48.2 + 2.8 * k, 0.5, "N/m") for k, one in enumerate(sets)}
    differences = {one: fitted(1.06, 0.02) for one in sets[1:]}
    spread = fitted(0.03, 0.01) if len(sets) > 2 else None
    mean = fitted(50.0, 0.4, "N/m")
    return Between(name, "N/m", True, values, differences, p, p, mean, spread, **({"reason": ""} | more))


@pytest.fixture
def between(made_up) -> BetweenSets:
    sets = tuple(SetFit(name, Path(name), made_up.base, None, None, 1.01) for name in "ab")
    return BetweenSets(
        sets,
        (
            parameter("position_gain", 0.0004),
            dataclasses.replace(parameter("friction", 0.6), is_ratio=False),
            parameter("damping", float("nan"), reason="b hardly fixes it"),
        ),
    )


def text_of(table) -> str:
    console = Console(width=200, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    with console.file:
        console.print(table)
    return console.export_text()


def test_the_answer_names_what_differs_what_does_not_and_what_can_not_be_told(between):
    assert report.answer(between, FLOOR) == (
        "the sets differ in position_gain (48.2 in a, 51 in b; p 0.0004); no difference was found in 1 other parameter;"
        " damping can't be told: b hardly fixes it"
    )
    alike = dataclasses.replace(between, parameters=between.parameters[1:2])
    assert report.answer(alike, FLOOR) == "no difference was found in 1 parameter"
    assert report.answer(dataclasses.replace(between, parameters=()), FLOOR) == "they have no parameter in common"


def test_a_model_that_lacks_something_is_doubted_first(between):
    poor = dataclasses.replace(between, sets=(between.sets[0], dataclasses.replace(between.sets[1], error=1.6)))
    assert "The model leaves 1.60 × noise in b alone: what it lacks may pass for a difference" in report.answer(
        poor, FLOOR
    )
    assert "lacks" not in report.answer(poor, 1.2)


def test_the_table_has_what_differs_first(between):
    lines = [line for line in text_of(report.printed(between)).splitlines() if "N/m" in line]
    assert [line.split()[0] for line in lines] == ["position_gain", "damping", "friction"]
    assert all(part in lines[0] for part in ("48.2", "51", "× 1.06 (1.04 to 1.08)", "0.0004", "differs"))
    assert "can't be told, b hardly fixes it" in lines[1]
    assert "+1.06 (1.04 to 1.08)" in lines[2]


def test_a_set_may_have_any_name(between, tmp_path):
    named = dataclasses.replace(
        between, sets=tuple(dataclasses.replace(one, name=f"{NASTY}[/red]{k}") for k, one in enumerate(between.sets))
    )
    assert "[red][/red]0" in text_of(report.printed(named))
    path = write_report(tmp_path / "report.html", "a", "b", [report.section(named, FLOOR)], {})
    assert "<script>alert" not in path.read_text()


def test_a_set_without_the_parameter_and_a_spread_have_their_place(between):
    three = dataclasses.replace(
        between, sets=(*between.sets, dataclasses.replace(between.sets[0], name="c")),
        parameters=(parameter("position_gain", 1e-9, ("a", "b", "c")), parameter("friction", 0.5)),
    )  # fmt: skip
    first, second = [line for line in text_of(report.printed(three)).splitlines() if "N/m" in line]
    assert "50 (49.6 to 50.4)" in first
    assert "3.0% (2.0% to 4.0%)" in first
    assert "< 0.0001" in first
    assert "–" in second


def test_the_json_holds_all_of_it(between, made_up):
    found = report.between_json(between)
    assert [one["set"] for one in found["sets"]] == ["a", "b"]
    gain, damping = found["parameters"]["position_gain"], found["parameters"]["damping"]
    assert gain["agreement"] == "differs"
    assert gain["values"]["b"] == {"value": 51.0, "low": 50.5, "high": 51.5}
    assert gain["ratios"]["b"]["value"] == 1.06
    assert gain["p_corrected"] == 0.0004
    assert gain["shared"] is None  # two sets that differ have none
    assert found["parameters"]["friction"]["shared"]["value"] == 50.0
    assert "differences" in found["parameters"]["friction"]
    assert (damping["agreement"], damping["reason"]) == ("cannot_tell", "b hardly fixes it")
    whole = dataclasses.replace(made_up.comparison, between=between)
    assert comparison_report.compare_json(whole, "a + b", "m", [])["between_sets"] == found
    assert comparison_report.compare_json(made_up.comparison, "a", "m", [])["between_sets"] is None


def test_the_report_draws_each_parameter_and_marks_what_differs(between, made_up):
    whole = dataclasses.replace(made_up.comparison, between=between)
    section = next(s for s in comparison_report.sections(whole, []) if s.title == "Between the sets")
    (table,) = [block for block in section.blocks if isinstance(block, Table)]
    assert table.marked == {0}
    assert table.rows[0][1] == "48.2 (47.7 to 48.7)"
    (picture,) = [block for block in section.blocks if isinstance(block, Picture)]
    titles = [axes.get_title(loc="left") for axes in picture.figure.axes]
    assert titles == ["position_gain [N/m] – differs", "damping [N/m]", "friction [N/m]"]
    names = [[tick.get_text() for tick in axes.get_yticklabels()] for axes in picture.figure.axes]
    assert names == [["a", "b"], ["a", "b"], ["a", "b", "all"]]
    box = comparison_report.answer_box(whole, [], after_comparison(whole, "[a,b]", "m.yaml"))
    assert dict(box.rows)["Between the sets"].startswith("the sets differ in position_gain")


def test_sets_that_differ_are_diagnosed_one_by_one(between, made_up):
    whole = dataclasses.replace(made_up.comparison, between=between)
    lines = [command.line for command in after_comparison(whole, "[a,b]", "m.yaml")]
    assert lines == ["forcegrasp diagnose data=a model=m.yaml", "forcegrasp diagnose data=b model=m.yaml"]
    alike = dataclasses.replace(between, parameters=between.parameters[1:])
    whole = dataclasses.replace(made_up.comparison, between=alike)
    assert [c.line for c in after_comparison(whole, "s", "m.yaml")] == ["forcegrasp diagnose data=s model=m.yaml"]
