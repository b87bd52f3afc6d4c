"""Policies on a population of robots: paired by robot, halves apart, and every claim from its numbers."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest
from rich.console import Console
from scipy import stats

from forcegrasp.config import EvaluateConfig, GraspConfig, PhysicsConfig
from forcegrasp.env.episodes import METRICS
from forcegrasp.evaluate.compare_policies import evaluate
from forcegrasp.evaluate.robot_report import robot_sentences, robot_sheets
from forcegrasp.evaluate.robot_statistics import _welch, describe_robots
from forcegrasp.evaluate.table1 import PAPER, nearest_to_table
from forcegrasp.models.robots import population
from forcegrasp.physics import default_gripper

ROBOTS = population(default_gripper(), 40)
LAGS = ROBOTS.has("force_lag")


def made_up(**rewards: np.ndarray) -> dict:
    """Policy → metrics of 40 robots × 2 grasps; all is 1, but for rewards ``(40,)``."""
    found = {}
    for name, values in rewards.items():
        both = values[:, None] + np.array([-0.5, 0.5])
        found[name] = {metric: both if "reward" in metric else np.ones((40, 2)) for metric in METRICS}
    return found


def report(**rewards: np.ndarray) -> dict:
    facts = {"robots": 40, "trials": 2, "gripper": "mine", "physics": "fast"}
    facts["baseline"] = "force_pi" if "force_pi" in rewards else ""
    return facts | describe_robots(made_up(**rewards), ROBOTS, facts["baseline"], 0)


@pytest.fixture(scope="module")
def found() -> dict:
    """``ib`` is ahead by 2, by 12 with a lag, and 7 behind on robot 5."""
    base = np.random.default_rng(0).uniform(50, 100, 40)
    return report(ib=base + 2 + 10 * LAGS - (9 + 10 * LAGS) * (np.arange(40) == 5), force_pi=base)


def test_differences_are_paired_and_of_each_half(found):
    test, development = (
        next(d for d in found["differences"] if (d["half"], d["metric"]) == (half, "force_reward_normalised"))
        for half in ("test", "development")
    )
    assert (test["worst_robot"], test["beyond_margin"], development["beyond_margin"]) == (5, 1, 0)
    assert test["worst"] == pytest.approx(-7)
    assert development["mean"] == pytest.approx(2 + 10 * LAGS[::2].mean())
    assert development["low"] <= development["mean"] <= development["high"]
    assert (test["better_share"], development["better_share"]) == (0.95, 1.0)


def test_an_effect_that_makes_the_difference_is_named(found):
    first = found["effects"][0]
    assert (first["effect"], first["certain"], first["robots"]) == ("force_lag", True, LAGS.sum())
    assert first["with"] - first["without"] == pytest.approx(first["change"])
    assert first["low"] < first["change"] < first["high"]
    said = " ".join(robot_sentences(found))
    assert "force_lag changes the lead of ib over force_pi by" in said


def test_never_worse_is_said_of_those_that_are_not(found):
    def never(report: dict) -> str:
        return next(line for line in robot_sentences(report) if line.startswith("By actual forces")).rpartition(": ")[2]

    flat = np.full(40, 70.0)
    assert never(found) == "none."
    assert never(report(ib=flat - 2.9, no_ib=flat - 3.1, force_pi=flat)) == "ib."


def test_the_papers_order_is_counted():
    flat = np.full(40, 70.0)
    ahead = report(ib=flat + 2 * (np.arange(40) % 4 == 0), no_ib=flat + 1, no_rand=flat - 1)
    assert ahead["order"]["force_reward_normalised"] == {"development": 0.5, "test": 0.0}
    assert "holds by actual forces on 50 % (development), 0 % (test)" in " ".join(robot_sentences(ahead))
    assert report(ib=flat, force_pi=flat + 1)["order"] == {}


def test_robots_of_the_population_are_compared_and_written_down(tmp_path, monkeypatch):
    monkeypatch.setattr("forcegrasp.evaluate.rollouts.BATCH", 8)  # robots of different batches
    monkeypatch.setattr("forcegrasp.evaluate.compare_robots.BATCH", 8)
    console = Console(file=io.StringIO(), width=80)
    tiny = {"kappas": 2, "trials": 2, "grasp": GraspConfig(steps=25), "physics": PhysicsConfig(tier="fast", threads=1)}
    config = EvaluateConfig(policies=["force_pi", "close"], robots=4, **tiny)
    report = evaluate(config, tmp_path, console)
    assert json.loads((tmp_path / "evaluation.json").read_text()) == report
    with open(tmp_path / "trials.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["policy"] == "close"]
    for robot in range(4):
        own = [float(row["force_reward_measured"]) for row in rows if row["cell"] == str(robot)]
        written = report["per_robot"][robot]["means"]["close"]["force_reward_measured"]
        assert len(own) == 4
        assert written == pytest.approx(np.mean(own), abs=1e-3)
        gain = report["per_robot"][robot]["parts"]["velocity_gain"]
        (used,) = {float(row["b2"]) for row in rows if row["cell"] == str(robot)}
        assert used == pytest.approx(gain)
    peaks = [[row["peak_force_n"] for row in rows if row["cell"] == str(robot)] for robot in range(4)]
    assert len({tuple(values) for values in peaks}) == 4  # the same grasps, different robots
    said = console.file.getvalue()
    assert all(len(line) <= 80 for line in said.splitlines() if "report:" not in line)
    assert "close" in said
    assert {"report.html", "robots.png", "tables.md"} <= {path.name for path in tmp_path.iterdir()}
    assert all(len(row) == len(sheet.header) for sheet in robot_sheets(report) for row in sheet.rows)


def test_welch_is_as_scipy_has_it():
    one, other = np.random.default_rng(1).normal(size=(2, 9)) * [[1], [3]]
    change, error, freedom = _welch(one, other[:5])
    test = stats.ttest_ind(one, other[:5], equal_var=False)
    assert (change / error, freedom) == (pytest.approx(test.statistic), pytest.approx(test.df))


def test_the_robot_of_the_papers_table_is_found():
    def row(known: tuple) -> np.ndarray:
        return (
            np.repeat(np.array([*known, *[(0, 0)] * (6 - len(known))])[None, :, :1], 40, 0).repeat(2, 2).reshape(40, 12)
        )

    metrics = {
        name: {"force_reward_measured": row(rewards).astype(float), "displacement_total_mm": row(moved).astype(float)}
        for name, (rewards, moved) in PAPER.items()
    }
    metrics["ib"]["force_reward_measured"] += np.where(np.arange(40) == 7, 0.0, 3.0 + 30 * ~LAGS)[:, None]
    found = nearest_to_table(metrics, ROBOTS)
    assert (found["nearest"][0], found["distances"][7]) == (7, 0)
    deviations = np.array([deviation for _, deviation in PAPER["ib"][0]])
    other = int(np.flatnonzero(LAGS & (np.arange(40) != 7))[0])
    assert found["distances"][other] == pytest.approx(np.sqrt(((3 / deviations) ** 2).sum() / 44))
    assert found["common"][0]["effect"] == "force_lag"
    assert len(found["nearest"]) == 4
