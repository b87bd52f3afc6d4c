"""Every option of evaluate changes something: with it, a tiny evaluation finds something else."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from forcegrasp.cli.main import main
from forcegrasp.cli.options import leaves
from forcegrasp.config import EvaluateConfig
from forcegrasp.errors import ConfigError
from forcegrasp.evaluate.compare_policies import evaluate
from tests.config.tiny_runs import (
    ELSEWHERE,
    MODEL,
    SHARED_CASES,
    TINY_GRASP,
    draw_nothing,
    threads_asked,
    with_options,
)

pytestmark = pytest.mark.usefixtures("undrawn")

TINY_EVALUATION = TINY_GRASP | {"kappas": 2, "trials": 2}

#: Option → another value than in the tiny evaluation.
EVALUATE_CASES: dict[str, Any] = {
    "policies": ["informed"],
    "out": "elsewhere",
    "detail": True,
    "baseline": "run",
    "objects": "paper",
    "kappas": 3,
    "trials": 3,
    "gripper": "franka_hand",
    "seed": 1,
    "model": str(MODEL),
    "robots": 4,
    **SHARED_CASES,
    "speed_threshold_m": 0.0,
}


def evaluated(folder: Path, **values: Any) -> dict[str, Any]:
    """What a tiny evaluation finds, less what merely repeats its configuration."""
    report = evaluate(with_options(EvaluateConfig(), TINY_EVALUATION | values), folder, Console(file=io.StringIO()))
    return {"policies": report["policies"], "trials": (folder / "trials.csv").read_text()}


@pytest.fixture(scope="module")
def learned(plain_training, run_path) -> dict[str, list[str]]:
    """A policy that sees every reading, which the hand-written controllers do not."""
    return {"policies": [str(run_path)]}


@pytest.fixture(scope="module")
def plain_evaluation(tmp_path_factory, learned):
    with pytest.MonkeyPatch.context() as patch:
        draw_nothing(patch)
        return evaluated(tmp_path_factory.mktemp("evaluate"), **learned)


def test_every_option_of_evaluate_has_a_case():
    assert list(EVALUATE_CASES) == [name for name, *_ in leaves(EvaluateConfig)]


def test_the_same_evaluation_finds_the_same(tmp_path, plain_evaluation, learned):
    assert evaluated(tmp_path, **learned) == plain_evaluation


@pytest.mark.parametrize(
    "name",
    [n for n in EVALUATE_CASES if n not in ("gripper", "out", "detail", "baseline", "physics.threads", *ELSEWHERE)],
)
def test_option_of_evaluate(name, tmp_path, plain_evaluation, learned):
    different = evaluated(tmp_path, **learned | {name: EVALUATE_CASES[name]})
    assert different != plain_evaluation


def test_baseline_of_evaluate_is_what_others_are_held_against(tmp_path, learned):
    both = {"policies": [*learned["policies"], "close"]}
    names = ("close", EVALUATE_CASES["baseline"])
    one, other = (evaluated(tmp_path / name, **both, baseline=name) for name in names)
    assert one != other


def test_gripper_of_evaluate_is_simulated_and_moves_no_policy_of_another(tmp_path, learned):
    plain = evaluated(tmp_path / "one", policies=["close"])
    assert evaluated(tmp_path / "two", policies=["close"], gripper=EVALUATE_CASES["gripper"]) != plain
    with pytest.raises(ConfigError, match="was trained on gripper tiago, and can't move franka_hand"):
        evaluated(tmp_path / "three", **learned | {"gripper": EVALUATE_CASES["gripper"]})


def test_threads_of_evaluate_reach_the_engine(tmp_path):
    with threads_asked() as asked:
        evaluated(tmp_path, **{"physics.threads": EVALUATE_CASES["physics.threads"]})
    assert set(asked) == {2}


def test_out_is_where_evaluate_writes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tiny = [f"{name}={value}" for name, value in TINY_EVALUATION.items()]
    assert main(["evaluate", *tiny, f"out={EVALUATE_CASES['out']}"]) == 0
    assert json.loads((tmp_path / EVALUATE_CASES["out"] / "evaluation.json").read_text())["trials"] == 2


def test_detail_of_evaluate_prints_more(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    tiny = [f"{name}={value}" for name, value in TINY_EVALUATION.items()]
    said = []
    for detail in (False, EVALUATE_CASES["detail"]):
        assert main(["evaluate", *tiny, "out=here", f"detail={detail}"]) == 0
        said.append(capsys.readouterr().out)
    assert "interquartile mean" in said[1]
    assert "interquartile mean" not in said[0]
