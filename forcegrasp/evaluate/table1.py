"""Which robots would have given the paper's Table 1, the only results of a real robot that there are."""

from __future__ import annotations

import numpy as np
from scipy.stats import fisher_exact

from forcegrasp.models.robots import Robots

#: Lach et al. (2023), Table 1: force reward (of 150, measured forces) and object movement [mm] of its six objects, in
#: the order of ``objects=paper``, mean and standard deviation of 20 trials. The mug's movement is not given.
PAPER = {
    "force_pi": (
        ((92, 15), (96, 14), (114, 5), (118, 7), (108, 7), (115, 10)),
        ((1.6, 0.8), (3.1, 2.1), (1.9, 0.6), (0.9, 0.4), (1.0, 0.9)),
    ),
    "ib": (
        ((96, 15), (103, 7), (109, 17), (115, 16), (105, 15), (120, 10)),
        ((1.5, 0.8), (3.2, 1.4), (1.8, 0.8), (1.2, 0.6), (0.7, 0.7)),
    ),
    "no_ib": (
        ((77, 10), (74, 26), (88, 33), (98, 34), (101, 16), (106, 17)),
        ((2.8, 1.4), (4.0, 0.9), (2.4, 0.7), (1.9, 0.6), (1.7, 0.4)),
    ),
    "no_rand": (
        ((82, 12), (97, 15), (57, 37), (53, 39), (49, 33), (40, 41)),
        ((2.6, 1.6), (3.6, 1.3), (2.6, 0.9), (1.7, 0.7), (1.8, 0.9)),
    ),
}
#: Share of the robots that count as nearest.
NEAREST = 0.1


def nearest_to_table(metrics: dict[str, dict[str, np.ndarray]], robots: Robots) -> dict:
    """How far robots are from the table, and what the nearest ones have that the others have not.

    A distance is the root of the mean square over 24 rewards and 20 movements, each in standard deviations of the
    paper's trials: 1 is as far as a single trial of the paper's is from its mean.

    Args:
      metrics: policy → metric → values, ``(robots, 6 × trials)``, object after object; of all policies of the table.
      robots: the population.
    """
    squares = []
    for name, (rewards, movements) in PAPER.items():
        for metric, known in (("force_reward_measured", rewards), ("displacement_total_mm", movements)):
            means = metrics[name][metric].reshape(len(robots), len(PAPER["ib"][0]), -1).mean(axis=2)
            mean, deviation = np.array(known).T
            squares.append(((means[:, : len(known)] - mean) / deviation) ** 2)
    distances = np.sqrt(np.concatenate(squares, axis=1).mean(axis=1))
    near = np.zeros(len(robots), bool)
    near[np.argsort(distances)[: max(1, round(NEAREST * len(robots)))]] = True
    effects = [name for name in dict.fromkeys(e.effect.name for e in robots.effects) if not robots.has(name).all()]
    found = []
    for name in effects:
        has = robots.has(name)
        counts = [[int((has & group).sum()), int((~has & group).sum())] for group in (near, ~near)]
        p_value = float(np.asarray(fisher_exact(counts))[1])
        shares = [float(has[group].mean()) for group in (near, ~near)]
        found.append(
            {"effect": name, "nearest": shares[0], "others": shares[1], "p": p_value}
            | {"certain": p_value * len(effects) < 0.05}  # Bonferroni's
        )
    return {
        "distances": distances.tolist(),
        "nearest": np.flatnonzero(near)[np.argsort(distances[near])].tolist(),
        "within_one": int((distances <= 1).sum()),
        "common": sorted(found, key=lambda one: one["p"]),
    }
