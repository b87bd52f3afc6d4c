"""An evaluation in a few sentences, and in one table that fits into a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console

from forcegrasp.evaluate.policies import EvaluatedPolicy
from forcegrasp.evaluate.tables import Sheet, half_interval, print_sheet, print_short, sheets

REWARD = "force_reward_normalised"


def print_summary(report: dict, console: Console, detail: bool) -> None:
    """Prints sentences and the short table, and with ``detail`` all other tables."""
    for sentence in sentences(report):
        console.print(sentence, highlight=False, markup=False)
    print_short(short_sheet(report), console)
    console.print(legend(report), highlight=False, markup=False)
    for sheet in sheets(report) if detail else ():
        print_sheet(sheet, console)


def simulator_notes(model: str, policies: Sequence[EvaluatedPolicy]) -> list[str]:
    """A line for each policy that was trained with a model and is judged without one."""
    if model:
        return []
    return [
        f"{one.name} was trained with the model {one.model}, but is judged here on the nominal gripper"
        + (f"; to judge it on its own: model={one.model_file}" if one.model_file else "")
        for one in policies
        if one.model
    ]


def sentences(report: dict) -> list[str]:
    """What was done, who is ahead, where each is weakest, who beats the baseline, and what to bear in mind."""
    cells, policies = len(report["cells"]), report["policies"]
    by_object = report["what"] == "object"
    kind = ("object" if by_object else "softness value") + "s" * (cells > 1)
    gripper = f"model {report['model']}" if report["model"] else "the nominal gripper"
    found = [
        f"{cells * report['trials']} grasps, the same for every policy: {cells} {kind} × {report['trials']}. Simulated:"
        f" {gripper}, physics={report['physics']}.",
        _ranking({name: metrics[REWARD] for name, metrics in policies.items()}, report["steps"]),
    ]
    if cells > 1:
        found.append(f"Weakest: {', '.join(_weakest(n, f[REWARD], report, by_object) for n, f in policies.items())}.")
    return [*found, *report["notes"]]


def _ranking(rewards: dict[str, dict], best_possible: int) -> str:
    """Who has the largest force reward; those whose intervals overlap with the best one's are level with it."""
    order = sorted(rewards, key=lambda name: -rewards[name]["mean"])
    said = {name: f"{name} {rewards[name]['mean']:.1f}" for name in order}
    level = [name for name in order if rewards[name]["high"] >= rewards[order[0]]["low"]]
    behind = [said[name] for name in order if name not in level]
    text = f"Force reward, {best_possible} at best: " + _listed([said[name] for name in level])
    if len(level) > 1:
        text += f" are level (their 95 % intervals overlap{'; ahead of ' + _listed(behind) if behind else ''})"
    elif behind:
        text += f", ahead of {_listed(behind)}"
    return f"{text}."


def _weakest(name: str, reward: dict, report: dict, by_object: bool) -> str:
    means = [cell["mean"] for cell in reward["by_cell"]]
    worst = min(means)
    return f"{name} {'with ' if by_object else 'at κ '}{report['cells'][means.index(worst)]} ({worst:.1f})"


def _listed(words: list[str]) -> str:
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def short_sheet(report: dict) -> Sheet:
    """A row per policy, narrow enough for 80 columns."""
    judged = report["baseline"] and len(report["policies"]) > 1
    last = ("reward,\nmeasured", "force_reward_measured") if report["model"] else ("goal\nafter [s]", "reach_s")
    rows = []
    for name, metrics in report["policies"].items():
        moved = f"{metrics['displacement_until_grasped_mm']['mean']:.3f}"
        row = [name, half_interval(metrics[REWARD], 1), moved, f"{metrics['overshoot_percent']['mean']:.0f}"]
        row.append(half_interval(metrics[last[1]], 1 if report["model"] else 2))
        rows.append([*row, _probability(metrics[REWARD].get("improvement"))] if judged else row)
    header = ["policy", "force\nreward", "moved\n[mm]", "over-\nshoot", last[0]]
    return Sheet("", [*header, "better than\nbaseline"] if judged else header, rows)


def legend(report: dict) -> str:
    """What the columns of the short table are."""
    text = "±: half of the 95 % interval. Moved: until both fingers touch. Overshoot: in % of the goal."
    if report["model"]:
        text += " Measured: by what the sensors say, before noise."
    else:
        text += " Goal after: time until within 2 σ_f of it."
    if report["baseline"] and len(report["policies"]) > 1:
        cell = "object" if report["what"] == "object" else "softness"
        text += f" Baseline: {report['baseline']}; how likely a larger force reward is, on grasps of the same {cell}."
    return text


def _probability(better: dict | None) -> str:
    if not better:
        return ""
    half = (better["high"] - better["low"]) / 2
    return f"{100 * better['probability']:.0f} ± {100 * half:.0f} %"
