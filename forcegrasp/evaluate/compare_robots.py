"""Evaluates policies on a population of robots: the same grasps by every policy on every robot."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from rich.console import Console
from rich.progress import Progress

from forcegrasp.config import EvaluateConfig, RewardConfig
from forcegrasp.env.episodes import METRICS, summarise
from forcegrasp.evaluate.grids import PAPER_OBJECTS, Grid, make_grid
from forcegrasp.evaluate.policies import EvaluatedPolicy, load_policies
from forcegrasp.evaluate.robot_figure import draw_robots
from forcegrasp.evaluate.robot_report import print_robots, robot_sheets, write_robots_page
from forcegrasp.evaluate.robot_statistics import describe_robots
from forcegrasp.evaluate.rollouts import BATCH, roll_out
from forcegrasp.evaluate.table1 import PAPER, nearest_to_table
from forcegrasp.evaluate.tables import markdown
from forcegrasp.evaluate.trials_file import write_trials
from forcegrasp.gpu import check_engine
from forcegrasp.models.robots import FixedRobots, Robots, population
from forcegrasp.physics import Gripper
from forcegrasp.physics.completion import complete


def compare_robots(config: EvaluateConfig, out: Path, console: Console) -> dict:
    """Rolls every policy out on every robot; prints a summary and writes everything into ``out``.

    Writes ``report.html``, ``evaluation.json`` (the returned report), ``tables.md``, ``trials.csv`` (one row per trial;
    its cells are the robots' numbers), and ``robots.png``.

    Raises:
      ConfigError, CheckpointError, MeasurementError, PhysicsError: with what to do about it.
    """
    torch.set_num_threads(1)
    check_engine(config.physics)
    policies = load_policies(config.policies, config.gripper)
    gripper = policies[0].gripper
    config = complete(config, gripper)
    robots, grid = population(gripper, config.robots), make_grid(config, gripper)
    everywhere = _repeated(grid, robots)
    out.mkdir(parents=True, exist_ok=True)
    batches = -(-len(everywhere.grasps) // BATCH)
    metrics: dict[str, dict[str, np.ndarray]] = {}
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("", total=len(policies) * batches)
        for evaluated in policies:
            progress.update(task, description=evaluated.name)
            parts = []
            for part in _rolled_out(evaluated, config, gripper, robots, everywhere):
                parts.append(part)
                progress.advance(task)
            metrics[evaluated.name] = {
                metric: np.concatenate([part[metric] for part in parts]).reshape(len(robots), -1) for metric in METRICS
            }
    report = {
        "seed": config.seed,
        "robots": len(robots),
        "trials": everywhere.trials,
        "steps": config.grasp.steps,
        "physics": config.physics.tier,
        "gripper": gripper.name,
        "cells": grid.cells,
        "what": grid.what,
        "baseline": config.baseline if config.baseline in metrics else "",
    }
    report |= describe_robots(metrics, robots, report["baseline"], config.seed)
    if config.objects == PAPER_OBJECTS and PAPER.keys() <= metrics.keys():
        report["table1"] = nearest_to_table(metrics, robots)
    (out / "tables.md").write_text(markdown(robot_sheets(report)), "utf-8")
    (out / "evaluation.json").write_text(json.dumps(report, indent=1, ensure_ascii=False) + "\n", "utf-8")
    write_trials(out / "trials.csv", everywhere, metrics)
    figure = draw_robots(report)
    figure.savefig(out / "robots.png", dpi=130)
    page = write_robots_page(out / "report.html", report, figure)
    print_robots(report, console, config.detail)
    more = "" if config.detail else ", which has all tables, as has detail=true"
    console.print(f"report: {page}{more}", highlight=False, markup=False, soft_wrap=True)
    return report


def _repeated(grid: Grid, robots: Robots) -> Grid:
    """The same grasps by every robot, with its own servo gain."""
    grasps = grid.grasps[np.tile(np.arange(len(grid.grasps)), len(robots))]
    gain = robots.gripper.training.servo_gain
    if gain:
        grasps = dataclasses.replace(grasps, b2=np.repeat(robots.base[gain], len(grid.grasps)))
    return Grid("robot", [str(number) for number in range(len(robots))], grasps)


def _rolled_out(
    evaluated: EvaluatedPolicy, config: EvaluateConfig, gripper: Gripper, robots: Robots, grid: Grid
) -> Iterator[dict[str, np.ndarray]]:
    """Metrics of some hundred grasps at a time, ``(grasps,)`` each."""
    for first in range(0, len(grid.grasps), BATCH):
        rows = np.arange(first, min(first + BATCH, len(grid.grasps)))
        episodes = roll_out(
            evaluated.policy,
            grid.grasps[rows],
            config.grasp,
            config.seed + first,
            gripper=gripper,
            physics=config.physics,
            sensors=config.sensors,
            robots=FixedRobots(robots[rows // grid.trials]),
            reward=RewardConfig(speed_threshold_m=config.speed_threshold_m),
            action=evaluated.action,
            observation=evaluated.observation,
        )
        summary = summarise(episodes, config.sensors, gripper.period_s)
        yield {metric: values.double().numpy() for metric, values in summary.items()}
