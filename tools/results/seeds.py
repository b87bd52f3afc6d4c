"""Evaluations of several seeds: which runs a table has, and which of them is shipped."""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

from forcegrasp.runs.provenance import experiment
from tools.results.policies import CONTROLLERS, Policy

#: What an evaluation found of one policy: figure → mean, median, …
Figures = dict[str, dict[str, Any]]


@cache
def read_evaluation(folder: Path) -> dict[str, Any]:
    """``evaluation.json`` of a folder."""
    return json.loads((folder / "evaluation.json").read_text("utf-8"))


def seeds_of(report: dict[str, Any]) -> dict[str, Figures]:
    """Of all runs in it, without the controllers."""
    return {name: figures for name, figures in report["policies"].items() if name not in CONTROLLERS}


def by_experiment(report: dict[str, Any], folders: Iterable[Path]) -> dict[str, list[Figures]]:
    """The seeds of each experiment, whose runs lie in one of those folders."""
    groups: dict[str, list[Figures]] = {}
    for name, figures in seeds_of(report).items():
        run = next(folder / name for folder in folders if (folder / name).is_dir())
        groups.setdefault(experiment(run), []).append(figures)
    return groups


def best_seed(policy: Policy, out: Path) -> tuple[Path, str]:
    """The run with the best median on the grasps of choosing, and a sentence that says so."""
    report = read_evaluation(out / f"evaluate-{policy.name}" / "development")
    medians = {name: figures[policy.judged_by]["median"] for name, figures in seeds_of(report).items()}
    best = max(medians, key=lambda name: medians[name])
    run = out / f"train-{policy.name}" / best
    number = json.loads((run / "run.json").read_text("utf-8"))["seed"]
    measured = " by measured forces" if policy.judged_by.endswith("measured") else ""
    listed = ", ".join(f"{median:.1f}" for median in sorted(medians.values(), reverse=True))
    return run, (
        f"Of {len(medians)} seeds it is seed {number}, which has the best median force reward{measured} on grasps that"
        f" stand in no table ({len(report['cells'])} × {report['trials']} by {report['what']}, seed {report['seed']}):"
        f" {listed}."
    )
