"""Evaluates policies on the same grasps and reports: tables, a file per trial, box plots and force traces."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import torch
from matplotlib.figure import Figure
from rich.console import Console
from rich.progress import track
from tensordict import TensorDictBase

from forcegrasp.config import EvaluateConfig, RewardConfig
from forcegrasp.env.episodes import summarise
from forcegrasp.evaluate.colours import policy_colours
from forcegrasp.evaluate.compare_robots import compare_robots
from forcegrasp.evaluate.grids import Grid, make_grid
from forcegrasp.evaluate.page import write_page
from forcegrasp.evaluate.plots import cell_boxes, force_traces
from forcegrasp.evaluate.policies import load_policies
from forcegrasp.evaluate.rollouts import roll_out
from forcegrasp.evaluate.statistics import Bootstrap
from forcegrasp.evaluate.summary import print_summary, simulator_notes
from forcegrasp.evaluate.tables import markdown, sheets
from forcegrasp.evaluate.trials_file import write_trials
from forcegrasp.gpu import check_engine
from forcegrasp.models.variation import read_model_of, with_noise_of
from forcegrasp.physics.completion import complete

#: Metrics of which more is better; of the others less is.
_MORE_IS_BETTER = ("force_reward_normalised", "force_reward_paper", "force_reward_measured")


def evaluate(config: EvaluateConfig, out: str | Path, console: Console | None = None) -> dict:
    """Rolls every policy out on the same grasps; prints a summary and writes everything into ``out``.

    With ``config.robots`` it is :func:`~forcegrasp.evaluate.compare_robots.compare_robots`.

    Writes ``report.html``, ``evaluation.json`` (the returned summary), ``tables.md``, ``trials.csv`` (one row per
    trial), ``force_reward.png``, ``displacement.png``, ``overshoot.png``, and ``traces_<policy>.png``.

    Raises:
      ConfigError, CheckpointError, MeasurementError, PhysicsError: with what to do about it.
    """
    out, console = Path(out), console or Console()
    if config.robots:
        return compare_robots(config, out, console)
    torch.set_num_threads(1)
    check_engine(config.physics)
    policies = load_policies(config.policies, config.gripper)
    gripper = policies[0].gripper
    model = read_model_of(gripper, config.model) if config.model else None
    config = complete(config, with_noise_of(gripper, model))
    baseline = config.baseline if config.baseline in {c.name for c in policies} else ""
    grid, colours = make_grid(config, gripper), policy_colours(c.name for c in policies)
    out.mkdir(parents=True, exist_ok=True)
    metrics: dict[str, dict[str, np.ndarray]] = {}
    traces: dict[str, Figure] = {}
    for evaluated in track(policies, description="evaluating", console=console, transient=True):
        episodes = roll_out(
            evaluated.policy,
            grid.grasps,
            config.grasp,
            config.seed,
            gripper=gripper,
            physics=config.physics,
            sensors=config.sensors,
            model=model,
            reward=RewardConfig(speed_threshold_m=config.speed_threshold_m),
            action=evaluated.action,
            observation=evaluated.observation,
        )
        summary = summarise(episodes, config.sensors, gripper.period_s)
        metrics[evaluated.name] = {k: v.double().numpy().reshape(len(grid.cells), -1) for k, v in summary.items()}
        traces[evaluated.name] = force_traces(
            _spread(episodes), evaluated.name, colours[evaluated.name], gripper.period_s
        )
    report = {
        "seed": config.seed,
        "trials": grid.trials,
        "steps": config.grasp.steps,
        "physics": config.physics.tier,
        "gripper": gripper.name,
        "model": config.model,
        "what": grid.what,
        "cells": grid.cells,
        "baseline": baseline,
        "notes": simulator_notes(config.model, policies),
        "policies": _describe(metrics, baseline, config.seed),
    }
    (out / "tables.md").write_text(markdown(sheets(report)), "utf-8")
    (out / "evaluation.json").write_text(json.dumps(report, indent=1, ensure_ascii=False) + "\n", "utf-8")
    write_trials(out / "trials.csv", grid, metrics)
    boxes = _boxes(metrics, grid, config.grasp.steps)
    for name, figure in boxes.items():
        figure.savefig(out / f"{name}.png", dpi=130)
    for name, figure in traces.items():
        figure.savefig(out / f"traces_{name}.png", dpi=110)
    page = write_page(out / "report.html", report, boxes, traces)
    print_summary(report, console, config.detail)
    more = "" if config.detail else ", which has all tables, as has detail=true"
    console.print(f"report: {page}{more}", highlight=False, markup=False, soft_wrap=True)
    return report


def _boxes(metrics: dict[str, dict[str, np.ndarray]], grid: Grid, steps: int) -> dict[str, Figure]:
    """Box plots by the name of their file."""
    rewards = {name: values["force_reward_normalised"] for name, values in metrics.items()}
    moved = {name: np.maximum(values["displacement_total_mm"], 1e-3) for name, values in metrics.items()}
    beyond = {name: np.maximum(values["overshoot_percent"], 0.1) for name, values in metrics.items()}
    return {
        "force_reward": cell_boxes(rewards, grid.cells, grid.what, f"force reward of an episode ({steps} at best)"),
        "displacement": cell_boxes(moved, grid.cells, grid.what, "object moved in all [mm]", log=True),
        "overshoot": cell_boxes(beyond, grid.cells, grid.what, "largest force beyond the goal [%]", log=True),
    }


def _spread(episodes: TensorDictBase, count: int = 6) -> TensorDictBase:
    """A few episodes from the first cell to the last."""
    return episodes[torch.linspace(0, len(episodes) - 1, count).long()]


def _describe(metrics: dict[str, dict[str, np.ndarray]], baseline: str, seed: int) -> dict[str, dict]:
    cells, trials = next(iter(next(iter(metrics.values())).values())).shape
    bootstrap = Bootstrap(cells, trials, seed)
    described = {}
    for name, values in metrics.items():
        described[name] = {metric: bootstrap.describe(v) for metric, v in values.items()}
        for metric, v in values.items() if baseline and name != baseline else ():
            sign = 1 if metric in _MORE_IS_BETTER else -1
            better = bootstrap.improvement(sign * v, sign * metrics[baseline][metric])
            described[name][metric]["improvement"] = better
    return described
