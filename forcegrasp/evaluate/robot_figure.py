"""The picture of a population: what every policy gets on every robot, and how much more than the baseline."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from forcegrasp.evaluate.colours import policy_colours
from forcegrasp.evaluate.robot_statistics import HALVES, MARGIN

REWARD = "force_reward_normalised"


def draw_robots(report: dict) -> Figure:
    """Draws force rewards of actual forces.

    Args:
      report: what ``evaluation.json`` has.
    """
    names, colours = list(report["policies"]), policy_colours(report["policies"])
    rewards = np.array([[one["means"][name][REWARD] for name in names] for one in report["per_robot"]])
    order, baseline = np.argsort(rewards.mean(axis=1)), report["baseline"]
    figure = Figure(figsize=(11, 7.5 if baseline else 4.5), layout="constrained")
    above, *below = np.atleast_1d(figure.subplots(2 if baseline else 1, 1))
    places, test = np.arange(len(order)), order % 2 == HALVES.index("test")
    for column, name in enumerate(names):
        above.scatter(places[test], rewards[order[test], column], 16, color=colours[name], label=name)
        above.scatter(places[~test], rewards[order[~test], column], 16, facecolors="none", edgecolors=colours[name])
    above.vlines(places, rewards[order].min(axis=1), rewards[order].max(axis=1), color="#dddddd", lw=1, zorder=0)
    above.set_xticks(places if len(places) <= 20 else [], order.astype(str) if len(places) <= 20 else [])
    above.set_xlabel("robots, by the mean of all policies (filled: test half)")
    above.set_ylabel(f"force reward ({report['steps']} at best)")
    above.legend(fontsize=9, loc="lower left", bbox_to_anchor=(0, 1), ncols=8, frameon=False)
    for axes in below:
        for column, name in enumerate(names):
            if name != baseline:
                more = np.sort(rewards[:, column] - rewards[:, names.index(baseline)])
                axes.plot(100 * (np.arange(len(more)) + 0.5) / len(more), more, color=colours[name], lw=1.6)
        axes.axhline(0, color="#444444", lw=1)
        axes.axhline(-MARGIN, color="#444444", lw=0.8, ls=":")
        axes.set_xlim(0, 100)
        axes.set_xlabel("share of the robots [%], each policy's worst on the left")
        axes.set_ylabel(f"force reward beyond {baseline}'s")
        axes.grid(alpha=0.3)
    return figure
