"""What can be said about policies on a population of robots. A robot counts once, by the mean of its grasps.

Intervals are 95 % bootstrap intervals over robots. Differences are paired: the same grasps on the same robot.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from scipy.stats import t as student

from forcegrasp.env.episodes import METRICS
from forcegrasp.evaluate.statistics import Bootstrap
from forcegrasp.models.robots import Robots

#: Robots that policies may be developed on, and those that nobody tunes anything on.
HALVES = ("development", "test")
#: Metrics of which policies' differences are told, and whether more of them is better.
COMPARED = {
    "force_reward_normalised": True,
    "force_reward_measured": True,
    "displacement_total_mm": False,
    "crushed_percent": False,
    "lost_percent": False,
}
#: Points of force reward that a policy may lose to the baseline on a robot before it counts as worse there.
MARGIN = 3.0
#: What the paper found on its robot, best first.
PAPERS_ORDER = ("ib", "no_ib", "no_rand")
#: Fewest robots with an effect, and without it, from which something is said about it.
_FEWEST = 3

Metrics = dict[str, dict[str, np.ndarray]]


def describe_robots(metrics: Metrics, robots: Robots, baseline: str, seed: int) -> dict:
    """What ``evaluation.json`` has of the population.

    Args:
      metrics: policy → metric → values, ``(robots, grasps)``.
      robots: the population.
      baseline: policy that the others are held against; empty for none.
      seed: of the resampling.
    """
    numbers = np.arange(len(robots))
    halves: dict[str, np.ndarray] = dict(zip(HALVES, (numbers[::2], numbers[1::2]), strict=True))
    means: Metrics = {name: {m: v.mean(1) for m, v in values.items()} for name, values in metrics.items()}
    bootstraps = {half: Bootstrap(1, len(rows), seed) for half, rows in halves.items()}
    pairs = list(combinations(means, 2)) + [(name, baseline) for name in means if baseline and name != baseline]
    order = {m: _order(means, m, halves) for m in COMPARED} if set(PAPERS_ORDER) <= set(means) else {}
    return {
        "halves": {half: rows.tolist() for half, rows in halves.items()},
        "policies": {
            name: {
                metric: {half: _describe(bootstraps[half], values[metric][rows]) for half, rows in halves.items()}
                for metric in METRICS
            }
            for name, values in means.items()
        },
        "differences": [
            {"one": one, "other": other, "metric": metric, "half": half}
            | _difference(bootstraps[half], means[one][metric][rows], means[other][metric][rows], rows, more)
            for one, other in dict.fromkeys(pairs)
            for metric, more in COMPARED.items()
            for half, rows in halves.items()
        ],
        "order": order,
        "effects": [
            {"one": one, "other": other, "metric": metric} | found
            for one, other in combinations(means, 2)
            for metric in tuple(COMPARED)[:2]
            for found in _by_effect(means[one][metric] - means[other][metric], robots)
        ],
        "per_robot": [
            {
                "robot": k,
                "half": HALVES[k % 2],
                "parts": dict(robots.sizes(k)),
                "means": {name: {m: float(values[m][k]) for m in COMPARED} for name, values in means.items()},
            }
            for k in range(len(robots))
        ],
    }


def _describe(bootstrap: Bootstrap, values: np.ndarray) -> dict:
    found = bootstrap.describe(values[None])
    del found["by_cell"]
    return found | {"lowest": float(values.min()), "highest": float(values.max())}


def _difference(bootstrap: Bootstrap, one: np.ndarray, other: np.ndarray, rows: np.ndarray, more: bool) -> dict:
    """Paired difference one − other: its mean, how often one is better, and the robot where it is worst."""
    difference = one - other
    gain = difference if more else -difference
    found, worst = bootstrap.describe(difference[None]), int(np.argmin(gain))
    return {
        **{key: found[key] for key in ("mean", "low", "high")},
        "better_share": float(np.mean((gain > 0) + 0.5 * (gain == 0))),
        "worst": float(difference[worst]),
        "worst_robot": int(rows[worst]),
        "beyond_margin": int((gain < -MARGIN).sum()),  # of force rewards; other metrics have other units
    }


def _order(means: Metrics, metric: str, halves: dict[str, np.ndarray]) -> dict[str, float]:
    """Share of the robots on which the paper's order holds."""
    best, middle, last = (means[name][metric] * (1 if COMPARED[metric] else -1) for name in PAPERS_ORDER)
    holds = (best > middle) & (middle > last)
    return {half: float(holds[rows].mean()) for half, rows in halves.items()}


def _by_effect(difference: np.ndarray, robots: Robots) -> list[dict]:
    """Mean difference on robots with an effect less that on robots without it, all robots; Welch's interval."""
    names = dict.fromkeys(setting.effect.name for setting in robots.effects)
    groups = [(name, difference[has], difference[~has]) for name in names if len(has := robots.has(name))]
    groups = [(name, there, away) for name, there, away in groups if min(len(there), len(away)) >= _FEWEST]
    found = []
    for name, there, away in groups:
        change, error, freedom = _welch(there, away)
        found.append(
            {
                "effect": name,
                "robots": len(there),
                "with": float(there.mean()),
                "without": float(away.mean()),
                "change": change,
                "low": change - error * float(student.ppf(0.975, freedom)),
                "high": change + error * float(student.ppf(0.975, freedom)),
                # Bonferroni's, for all effects at once
                "certain": abs(change) > error * float(student.ppf(1 - 0.025 / len(groups), freedom)),
            }
        )
    return sorted(found, key=lambda one: -abs(one["change"]))


def _welch(one: np.ndarray, other: np.ndarray) -> tuple[float, float, float]:
    """Difference of two means, its standard error, and Welch's degrees of freedom."""
    parts = np.array([group.var(ddof=1) / len(group) for group in (one, other)])
    weights = parts**2 / (len(one) - 1, len(other) - 1)
    freedom = parts.sum() ** 2 / weights.sum() if weights.sum() > 0 else 1.0
    return float(one.mean() - other.mean()), float(np.sqrt(parts.sum())), float(freedom)
