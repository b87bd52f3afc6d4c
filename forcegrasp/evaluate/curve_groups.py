"""Runs of a sweep in groups that differ in nothing but the seed, and means over seeds."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from forcegrasp.config import TrainConfig
from forcegrasp.runs.history import History, flat

#: What is drawn and printed: column of metrics.csv, heading, digits. The rewards are of the true forces.
CURVES = (
    ("episode/force_reward_normalised", "force reward, normalised form", 1),
    ("episode/force_reward_paper", "force reward, paper's form", 1),
    ("episode/displacement_until_grasped_mm", "object moved until both touch [mm]", 3),
    ("episode/fast_steps", "steps over the speed threshold", 2),
)
#: Share of a training, at its end, that the table averages over.
LAST = 0.1
#: Options that change no result, or only which random numbers it came from.
_INDIFFERENT = ("seed", "physics.threads", "log.")


@dataclass
class Group:
    """Runs that differ in nothing but the seed."""

    label: str
    runs: list[History]

    @property
    def averaged(self) -> list[History]:
        """The finished runs, or all of them while there is none: a mean must not jump where one of them ends."""
        return [run for run in self.runs if run.finished] or self.runs

    def mean(self, column: str, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mean over seeds and its 95 % t-interval, each ``(len(frames),)``; NaN where a run has no value."""
        return interval(np.stack([_at(run, column, frames) for run in self.averaged]))

    def last(self, column: str) -> np.ndarray:
        """Mean over the last tenth of what each averaged run has trained, ``(runs,)``."""
        return np.array([run.values[column][run.frames > (1 - LAST) * run.frames[-1]].mean() for run in self.averaged])


def _at(run: History, column: str, frames: np.ndarray) -> np.ndarray:
    return np.interp(frames, run.frames, run.values[column], left=np.nan, right=np.nan)


def interval(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean over the first axis and its 95 % interval by Student's t; NaN as interval of a single value."""
    n, mean = len(values), values.mean(axis=0)
    if n == 1:
        return mean, np.full_like(mean, np.nan), np.full_like(mean, np.nan)
    half = student.ppf(0.975, n - 1) * values.std(axis=0, ddof=1) / math.sqrt(n)
    return mean, mean - half, mean + half


def group_runs(runs: list[History]) -> tuple[list[Group], list[str]]:
    """Puts runs that differ in nothing but the seed together, in the order in which they come.

    Returns:
      The groups, and a line for each run that is left out because another one has its configuration and seed.
    """
    differing = _differing(runs)
    groups: dict[str, dict[int, History]] = {}
    notes = []
    for run in runs:
        seeds = groups.setdefault(_said(run, differing), {})
        twin = seeds.get(run.seed)
        if twin:
            run, less = (run, twin) if run.frames[-1] > twin.frames[-1] else (twin, run)
            notes.append(f"{less.path} left out: same configuration and seed as {run.path}")
        seeds[run.seed] = run
    members = [[seeds[seed] for seed in sorted(seeds)] for seeds in groups.values()]
    return [Group(label, runs) for label, runs in zip(_labels(members), members, strict=True)], notes


def _labels(members: list[list[History]]) -> list[str]:
    """The experiment's name, and the options off their defaults in which its groups differ."""
    defaults = flat(dataclasses.asdict(TrainConfig()))
    labels = []
    for runs in members:
        name = runs[0].experiment if len({run.experiment for run in runs}) == 1 else ""
        rivals = [other[0] for other in members if not name or other[0].experiment == name]
        unusual = [option for option in _differing(rivals) if runs[0].options[option] != defaults.get(option)]
        labels.append(" ".join(filter(None, (name, _said(runs[0], unusual)))) or "defaults")
    return labels


def _differing(runs: list[History]) -> list[str]:
    """Names of the options that are not the same in all runs, less those that do not matter."""
    names = list(dict.fromkeys(name for run in runs for name in run.options))
    return [
        name
        for name in names
        if not name.startswith(_INDIFFERENT) and len({repr(run.options.get(name)) for run in runs}) > 1
    ]


def _said(run: History, names: list[str]) -> str:
    return " ".join(f"{name}={run.options.get(name)}".replace(" ", "").replace("'", "") for name in names)
