"""An evaluation in words, in one table that fits into a terminal, and as a page."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from rich.console import Console

from forcegrasp.env.episodes import METRICS
from forcegrasp.evaluate.page import write_page
from forcegrasp.evaluate.policies import EvaluatedPolicy
from forcegrasp.evaluate.statistics import Bootstrap
from forcegrasp.evaluate.summary import print_summary, sentences, short_sheet, simulator_notes
from forcegrasp.evaluate.tables import sheets

LONG = "2026-11-20_22-53-00_recommended_stiffening_contact_s0"


def made_up(rewards: dict[str, float], baseline: str = "force_pi", **facts: str) -> dict:
    """A report of policies whose force rewards have these means; the other figures are alike."""
    rng, bootstrap = np.random.default_rng(0), Bootstrap(2, 20, 0)
    policies: dict[str, dict] = {}
    for name, mean in rewards.items():
        values = {figure: rng.normal(100, 5, (2, 20)) for figure in METRICS}
        values["force_reward_normalised"] += mean - values["force_reward_normalised"].mean()
        policies[name] = {figure: bootstrap.describe(value) for figure, value in values.items()}
        if name != baseline in rewards:
            better = bootstrap.improvement(values["force_reward_normalised"], np.full((2, 20), rewards[baseline]))
            policies[name] = {figure: {**found, "improvement": better} for figure, found in policies[name].items()}
    report = {"seed": 0, "trials": 20, "steps": 150, "physics": "fast", "model": "", "what": "softness κ"}
    report |= {"cells": ["0", "1"], "baseline": baseline if baseline in rewards else "", "notes": []}
    return {**report, **facts, "policies": policies}


def printed(report: dict, width: int = 80, detail: bool = False) -> str:
    console = Console(file=io.StringIO(), width=width)
    print_summary(report, console, detail)
    return console.file.getvalue()


@pytest.mark.parametrize("facts", [{}, {"model": "runs/diagnose_2026-11-20_11-11-11/model.yaml"}])
def test_everything_fits_into_80_columns(facts):
    report = made_up({LONG: 115, "ib_virtual_robot_measured": 110, "force_pi": 100}, **facts)
    report["notes"] = simulator_notes(
        "", [EvaluatedPolicy(LONG, *[None] * 4, "a.yaml", Path(f"runs/{LONG}/model.yaml"))]
    )
    text = printed(report)
    assert max(map(len, text.splitlines())) <= 80
    assert "…" not in text
    rows = [row for row in text.splitlines() if re.search(r"\d ± \d", row)]
    assert len(rows) == 3, "numbers are not folded"
    assert LONG in re.sub(r"\s", "", text)


def test_who_is_ahead_and_who_is_level():
    assert "a 120.0, ahead of force_pi 100.0." in sentences(made_up({"force_pi": 100, "a": 120}))[1]
    three = sentences(made_up({"force_pi": 100, "a": 120, "b": 120.2}))[1]
    assert "b 120.2 and a 120.0 are level" in three
    assert "ahead of force_pi 100.0" in three
    alone = sentences(made_up({"force_pi": 100}))[1]
    assert alone == "Force reward, 150 at best: force_pi 100.0."


def test_weakest_cell_is_the_one_with_the_smallest_mean():
    report = made_up({"force_pi": 100})
    means = [cell["mean"] for cell in report["policies"]["force_pi"]["force_reward_normalised"]["by_cell"]]
    assert f"force_pi at κ {report['cells'][int(np.argmin(means))]} ({min(means):.1f})" in sentences(report)[2]


def test_no_table_is_empty_without_someone_to_hold_against():
    for report in (made_up({"force_pi": 100}), made_up({"close": 100, "nothing": 3})):
        for sheet in (short_sheet(report), *sheets(report)):
            assert len(sheet.header) >= 2, sheet.title
            assert all(len(row) == len(sheet.header) for row in sheet.rows), sheet.title
            assert "better" not in " ".join([sheet.title, *sheet.header])
        assert "Baseline" not in printed(report)


def test_detail_prints_all_tables():
    report = made_up({"ib": 115, "force_pi": 100})
    short, long = printed(report), re.sub(r"\s+", " ", printed(report, detail=True))
    titles = [sheet.title for sheet in sheets(report)]
    assert len(titles) >= 5
    for title in titles:
        assert title in long
        assert title not in short


def test_medians_and_percentiles_are_told_in_the_units_of_the_metric():
    report = made_up({"ib": 115, "force_pi": 100})
    found = report["policies"]["ib"]["peak_force_n"]
    told = [sheet for sheet in sheets(report) if "95th percentile" in sheet.title]
    row = next(row for row in told[0].rows if row[0] == "peak force, N")
    assert all(len(cell.splitlines()) == 1 for row in told[0].rows if row[0].startswith("crushed") for cell in row)
    mean, median, percentile = row[1].splitlines()
    assert mean.startswith(f"{found['mean']:.3f} ± ")
    assert median == f"{found['median']:.3f} [{found['median_low']:.3f}, {found['median_high']:.3f}]"
    assert percentile == f"{found['p95']:.3f} [{found['p95_low']:.3f}, {found['p95_high']:.3f}]"


def test_page_has_all_tables_and_pictures(tmp_path):
    report = made_up({"<ib>": 115, "force_pi": 100})
    drawn = [Figure() for _ in range(3)]
    path = write_page(tmp_path / "report.html", report, {"force_reward": drawn[0]}, {"<ib>": drawn[1], "x": drawn[2]})
    text = path.read_text("utf-8")
    assert text.count("<table>") == 1 + len(list(sheets(report)))
    assert text.count("<svg") == 3
    assert "&lt;ib&gt;" in text
    assert "<ib>" not in text
    for sentence in sentences(report):
        assert sentence.replace("<ib>", "&lt;ib&gt;") in text


def test_a_policy_of_a_model_says_on_which_simulator_it_is_judged():
    kept = EvaluatedPolicy("mine", *[None] * 4, "better.yaml", Path("runs/mine/model.yaml"))
    shipped = EvaluatedPolicy("ib_virtual_robot", *[None] * 4, "diag/model.yaml", None)
    plain = EvaluatedPolicy("ib", *[None] * 4)
    one, other = simulator_notes("", [kept, shipped, plain])
    assert one.startswith("mine was trained with the model better.yaml, but is judged here on the nominal gripper")
    assert one.endswith("model=runs/mine/model.yaml")
    assert "diag/model.yaml" in other
    assert "model=" not in other
    assert simulator_notes("other.yaml", [kept]) == []
    assert "nominal gripper" in sentences(made_up({"force_pi": 1}))[0]
    assert "model other.yaml" in sentences(made_up({"force_pi": 1}, model="other.yaml"))[0]
