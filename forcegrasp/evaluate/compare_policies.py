"""Evaluates policies on the same grasps and reports: a table, a file per trial, box plots and force traces."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.stats import bootstrap
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from forcegrasp.config import ActionConfig, EvaluateConfig, ObservationConfig, RewardConfig, TrainConfig
from forcegrasp.controllers import CONTROLLERS, make_controller
from forcegrasp.effects.variation import read_tiago_model
from forcegrasp.env.episodes import FIGURES, summarise
from forcegrasp.errors import ConfigError
from forcegrasp.evaluate.plots import force_traces, softness_boxes
from forcegrasp.evaluate.rollouts import kappa_grid, roll_out
from forcegrasp.runs.policy import load_policy

#: Figures that are printed: name, heading (escaped for rich), digits.
TABLE = (
    ("force_reward_normalised", "force reward,\nnormalised form", 1),
    ("force_reward_paper", "force reward,\npaper's form", 1),
    ("displacement_until_grasped_mm", "object moved until\nboth touch, mm", 3),
    ("displacement_total_mm", "object moved\nin all, mm", 3),
    ("fast_steps", "steps over the\nspeed threshold", 2),
)


@dataclass
class Contestant:
    """A policy under evaluation."""

    name: str
    policy: TensorDictModuleBase
    action: ActionConfig
    observation: ObservationConfig


def load_contestants(names: list[str]) -> list[Contestant]:
    """Loads controllers by name and trained policies by run directory; a controller's name wins.

    Raises:
      ConfigError, CheckpointError: if one can't be loaded.
    """
    if not all(names):
        raise ConfigError(f"policies={names}: a name is empty")
    paths = {name: Path(name).resolve() for name in names}
    contestants: dict[str, Contestant] = {}
    for name, path in paths.items():
        if name in CONTROLLERS or not ("/" in name or path.exists()):
            label, policy, config = name, make_controller(name), TrainConfig(action=ActionConfig(inductive_bias=False))
        else:
            same = [other for other in set(paths.values()) if other.name == path.name]
            label = path.name if len(same) == 1 else f"{path.parent.name}_{path.name}"
            policy, config = load_policy(name)
        if label in contestants:
            raise ConfigError(f"policies: {label} is named twice")
        contestants[label] = Contestant(label, policy, config.action, config.observation)
    if len(paths) < len(names):
        raise ConfigError(f"policies={names}: one is named twice")
    return list(contestants.values())


def evaluate(config: EvaluateConfig, out: Path, console: Console | None = None) -> dict:
    """Rolls every policy out on the same softness grid; prints the table and writes everything into ``out``.

    Writes ``evaluation.json`` (the returned summary), ``trials.csv`` (one row per trial), ``force_reward.png``,
    ``displacement.png``, and ``traces_<policy>.png``.

    Raises:
      ConfigError, CheckpointError, PhysicsError: with what to do about it.
    """
    console = console or Console()
    torch.set_num_threads(1)
    model = read_tiago_model(config.model) if config.model else None
    contestants = load_contestants(config.policies)
    grasps = kappa_grid(config.grasp, config.kappas, config.trials, config.seed)
    kappas = np.linspace(*config.grasp.kappa, config.kappas)
    out.mkdir(parents=True, exist_ok=True)
    figures: dict[str, dict[str, np.ndarray]] = {}
    for contestant in track(contestants, description="evaluating", console=console, transient=True):
        episodes = roll_out(
            contestant.policy,
            grasps,
            config.grasp,
            config.seed,
            physics=config.physics,
            sensors=config.sensors,
            model=model,
            reward=RewardConfig(speed_threshold_m=config.speed_threshold_m),
            action=contestant.action,
            observation=contestant.observation,
        )
        summary = summarise(episodes, config.sensors.contact_threshold_n)
        figures[contestant.name] = {k: v.double().numpy().reshape(len(kappas), -1) for k, v in summary.items()}
        force_traces(_spread(episodes), contestant.name).savefig(out / f"traces_{contestant.name}.png", dpi=110)
    report = {
        "seed": config.seed,
        "trials": config.trials,
        "steps": config.grasp.steps,
        "physics": config.physics.tier,
        "kappas": kappas.tolist(),
        "policies": {name: _summary(values, config.seed) for name, values in figures.items()},
    }
    (out / "evaluation.json").write_text(json.dumps(report, indent=1) + "\n")
    _write_trials(out / "trials.csv", grasps.as_array(), figures)
    rewards = {name: values["force_reward_normalised"] for name, values in figures.items()}
    softness_boxes(rewards, kappas, f"force reward of an episode ({config.grasp.steps} at best)").savefig(
        out / "force_reward.png", dpi=130
    )
    moved = {name: np.maximum(values["displacement_until_grasped_mm"], 1e-3) for name, values in figures.items()}
    softness_boxes(moved, kappas, "object moved until both touch [mm]", log=True).savefig(
        out / "displacement.png", dpi=130
    )
    _print(report, console)
    console.print(f"figures, trials and summary are in {out}", highlight=False)
    return report


def _spread(episodes: TensorDictBase, count: int = 6) -> TensorDictBase:
    """A few episodes from hard to soft."""
    return episodes[torch.linspace(0, len(episodes) - 1, count).long()]


def _summary(values: dict[str, np.ndarray], seed: int) -> dict[str, dict]:
    return {name: {**_interval(v, seed), "by_kappa": [_interval(row, seed) for row in v]} for name, v in values.items()}


def _interval(values: np.ndarray, seed: int) -> dict[str, float]:
    """Mean, standard deviation, and a 95 % bootstrap interval of the mean."""
    values = values.reshape(-1)
    low = high = values.mean()
    if np.ptp(values) > 0:
        interval = bootstrap(
            (values,), np.mean, n_resamples=1000, method="percentile", rng=np.random.default_rng(seed)
        ).confidence_interval
        low, high = interval.low, interval.high
    return {"mean": float(values.mean()), "std": float(values.std(ddof=1)), "low": float(low), "high": float(high)}


def _write_trials(path: Path, grasps: np.ndarray, figures: dict[str, dict[str, np.ndarray]]) -> None:
    columns = ["policy", "kappa", "b2", "radius_m", "offset_m", "goal_force_n", *FIGURES]
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        for name, values in figures.items():
            per_trial = np.stack([values[figure].reshape(-1) for figure in FIGURES], axis=1)
            for grasp, row in zip(grasps, per_trial, strict=True):
                writer.writerow([name, *(f"{x:.9g}" for x in grasp), *(f"{x:.6g}" for x in row)])


def _print(report: dict, console: Console) -> None:
    """Two tables that fit a narrow terminal: all grasps together, and by softness."""
    policies = report["policies"]
    table = Table(
        title=f"mean ± standard deviation [95 % interval of the mean] over episodes of {report['steps']} steps"
    )
    table.add_column("figure")
    for name in policies:
        table.add_column(name, justify="right", overflow="fold")
    for figure, heading, digits in TABLE:
        cells = (values[figure] for values in policies.values())
        table.add_row(
            heading,
            *(
                f"{c['mean']:.{digits}f} ± {c['std']:.{digits}f}\n[{c['low']:.{digits}f}, {c['high']:.{digits}f}]"
                for c in cells
            ),
        )
    console.print(table)
    for figure, heading, digits in TABLE[:3]:
        table = Table(title=f"{' '.join(heading.split())}: mean ± half of its 95 % interval")
        table.add_column("κ", justify="right")
        for name in policies:
            table.add_column(name, justify="right", overflow="fold")
        for index, kappa in enumerate(report["kappas"]):
            cells = [values[figure]["by_kappa"][index] for values in policies.values()]
            spans = (f"{c['mean']:.{digits}f} ± {(c['high'] - c['low']) / 2:.{digits}f}" for c in cells)
            table.add_row(f"{kappa:.3g}", *spans)
        console.print(table)
