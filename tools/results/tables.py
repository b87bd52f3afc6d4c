"""Tables of the pages, in Markdown, from evaluations of all seeds."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from forcegrasp.evaluate.curve_groups import interval
from forcegrasp.evaluate.robot_report import LEGEND, robot_sheets
from forcegrasp.evaluate.statistics import QUANTILES
from forcegrasp.evaluate.tables import SHARES, markdown
from tools.results.policies import CONTROLLERS, MEASURED, POLICIES, REWARD, SWEEPS
from tools.results.seeds import Figures, by_experiment, read_evaluation, seeds_of

#: Of a table's columns or rows: its name → the figures of each of its seeds; a controller has one.
Columns = dict[str, list[Figures]]
_PAPER = ("ib", "no_ib", "no_rand", "force_pi")
_USERS = ("recommended", "ib", "force_pi", "informed")
_ON_ROBOT = ("force_pi", "ib", "no_ib", "no_rand", "ib_virtual_robot", "ib_virtual_robot_measured")
#: Lach et al. (2023), Table 1: averages.
_PAPERS_ROBOT = {
    "force_pi": "107 ± 10; 1.7 ± 0.9 mm",
    "ib": "109 ± 13; 1.7 ± 0.9 mm",
    "no_ib": "89 ± 23; 2.6 ± 0.8 mm",
    "no_rand": "66 ± 30; 2.5 ± 1.1 mm",
}
#: The same by object, from the softest to the hardest, and the average.
_PAPERS_OBJECTS = {
    "paper: baseline": "92 ± 15, 96 ± 14, 114 ± 5, 118 ± 7, 108 ± 7, 115 ± 10, 107 ± 10",
    "paper: π^IB": "96 ± 15, 103 ± 7, 109 ± 17, 115 ± 16, 105 ± 15, 120 ± 10, 109 ± 13",
    "paper: π^NO-IB": "77 ± 10, 74 ± 26, 88 ± 33, 98 ± 34, 101 ± 16, 106 ± 17, 89 ± 23",
    "paper: π^NO-RAND": "82 ± 12, 97 ± 15, 57 ± 37, 53 ± 39, 49 ± 33, 40 ± 41, 66 ± 30",
}
_SEEDS = "Mean over seeds ± half of its 95 % t-interval; a hand-written controller has no seeds"
#: Figure → heading, digits, factor.
_ROWS = {
    REWARD: ("force reward, normalised form", 1, 1.0),
    "force_reward_paper": ("force reward, paper's form", 1, 1.0),
    "peak_force_n": ("peak force [N]", 3, 1.0),
    "overshoot_n": ("largest overshoot [N]", 3, 1.0),
    "overshoot_percent": ("largest overshoot [% of the goal]", 1, 1.0),
    "impact_impulse_ns": ("impact impulse beyond the goal [mN s]", 2, 1e3),
    "reach_s": ("time until within 2 σ_f of the goal [s]", 2, 1.0),
    "settled_s": ("time from which it stays there [s]", 2, 1.0),
    "final_force_error_n": ("force error over the last second [mN]", 1, 1e3),
    "final_force_difference_n": ("difference between the fingers over the last second [mN]", 1, 1e3),
    "command_effort": ("effort of the commands [mm]", 2, 1e3),
    "action_change": ("change of the actions", 2, 1.0),
    "displacement_until_grasped_mm": ("object moved until both touch [mm]", 3, 1.0),
    "displacement_after_grasped_mm": ("object moved after that [mm]", 3, 1.0),
    "displacement_total_mm": ("object moved in all [mm]", 3, 1.0),
    "crushed_percent": ("crushed [% of the grasps]", 1, 1.0),
    "lost_percent": ("lost [% of the grasps]", 1, 1.0),
    "fast_steps": ("steps over the speed threshold", 1, 1.0),
}
_IN_PAPER = (
    *(REWARD, "force_reward_paper", "displacement_until_grasped_mm", "displacement_total_mm"),
    *("overshoot_percent", "reach_s", "final_force_error_n"),
)
_IN_USERS_UNITS = tuple(name for name in _ROWS if name not in ("force_reward_paper", "fast_steps"))
_OF_SWEEPS = (REWARD, "force_reward_paper", "displacement_until_grasped_mm")


def over_seeds(values: Iterable[float], digits: int, factor: float = 1.0) -> str:
    """Mean and half of its interval; the value alone if there is one."""
    mean, _, high = interval(factor * np.array(list(values)))
    return f"{mean:.{digits}f}" + ("" if np.isnan(high) else f" ± {high - mean:.{digits}f}")


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """In Markdown."""
    head, *lines = (f"| {' | '.join(line)} |".replace("|  |", "| |") for line in (header, *rows))
    return "\n".join([head, "|" + "---|" * len(header), *lines])


def columns(out: Path, names: Sequence[str], where: str = "softness") -> Columns:
    """Each policy's or controller's seeds."""
    found = {}
    for name in names:
        if name in CONTROLLERS:
            found[name] = [read_evaluation(out / "evaluate-controllers" / where)["policies"][name]]
        else:
            found[name] = list(seeds_of(read_evaluation(out / f"evaluate-{name}" / where)).values())
    return found


def _row(name: str, found: Columns, cell: Callable[[list[Figures], str, int, float], str]) -> list[str]:
    heading, digits, factor = _ROWS[name]
    return [heading, *(cell(seeds, name, digits, factor) for seeds in found.values())]


def _mean(seeds: list[Figures], name: str, digits: int, factor: float) -> str:
    return over_seeds([one[name]["mean"] for one in seeds], digits, factor)


def _spread(seeds: list[Figures], name: str, digits: int, factor: float) -> str:
    """The mean, and unless it is a share the median and the 95th percentile."""
    kinds = () if name in SHARES else QUANTILES
    quantiles = (f"{factor * np.mean([one[name][kind] for one in seeds]):.{digits}f}" for kind in kinds)
    return "; ".join((_mean(seeds, name, digits, factor), *quantiles))


def _better(seeds: list[Figures]) -> str:
    found = [one[REWARD]["improvement"]["probability"] for one in seeds if "improvement" in one[REWARD]]
    return over_seeds(found, 2) if found else ""


def paper(out: Path) -> str:
    """The paper's simulation experiment."""
    found = columns(out, _PAPER)
    better = ["probability of a larger reward than force_pi (normalised)", *map(_better, found.values())]
    rows = [*(_row(name, found, _mean) for name in _IN_PAPER), better]
    return f"{_SEEDS}:\n\n" + table(["", *found], rows)


def users(out: Path) -> str:
    """In users' units."""
    found = columns(out, _USERS)
    rows = (_row(name, found, _spread) for name in _IN_USERS_UNITS)
    return f"{_SEEDS}; median; 95th percentile, both the mean over seeds:\n\n" + table(["", *found], rows)


def _by_softness(found: Columns, cells: list[str], name: str = REWARD) -> str:
    """A row per policy, a column per softness."""
    digits = _ROWS[name][1]
    rows = [
        [who, *(f"{np.mean([one[name]['by_cell'][k]['mean'] for one in seeds]):.{digits}f}" for k in range(len(cells)))]
        for who, seeds in found.items()
    ]
    return table(["κ", *cells], rows)


def _cells(out: Path, where: str = "softness") -> list[str]:
    return read_evaluation(out / "evaluate-controllers" / where)["cells"]


def paper_softness(out: Path) -> str:
    """Its force reward by softness."""
    return f"{_ROWS[REWARD][0].capitalize()}, by softness, mean over seeds:\n\n" + _by_softness(
        columns(out, _PAPER), _cells(out)
    )


def users_softness(out: Path) -> str:
    """Force reward and overshoot by softness."""
    found, cells = columns(out, _USERS), _cells(out)
    tables = (_by_softness(found, cells, name) for name in (REWARD, "overshoot_n"))
    return "By softness, force reward above and largest overshoot [N] below, mean over seeds:\n\n" + "\n\n".join(tables)


def _sweep(out: Path, sweep: str) -> Columns:
    folders = [out / f"train-{name}" for name in (*SWEEPS[sweep].beside, sweep)]
    return by_experiment(read_evaluation(out / f"evaluate-{sweep}" / "softness"), folders)


def ablation(out: Path, sweep: str = "ablation", shown: tuple[str, ...] = (*_OF_SWEEPS, "fast_steps")) -> str:
    """A row per experiment of a sweep, and each seed's force reward."""
    report, found = read_evaluation(out / f"evaluate-{sweep}" / "softness"), _sweep(out, sweep)
    each = {who: sorted(one[REWARD]["mean"] for one in seeds) for who, seeds in found.items()}
    rows = [
        [f"`{who}`", *figures(seeds, shown), " ".join(f"{reward:.1f}" for reward in each[who])]
        for who, seeds in found.items()
    ]
    rows.append(["hand-written (`force_pi`)", *figures([report["policies"]["force_pi"]], shown), ""])
    seeds = len(next(iter(found.values())))
    commands = [policy.options for policy in POLICIES if policy.name in SWEEPS[sweep].beside] + [SWEEPS[sweep].options]
    trained = ", ".join(f"`forcegrasp train -m {options}`" for options in commands)
    trained += f", {seeds} seeds each, {_frames(out, sweep):,} frames"
    grasps = f"evaluated on the same {len(report['cells'])} × {report['trials']} grasps of the reference tier"
    header = ["experiment", *headings(shown), "each seed's force reward"]
    return f"{trained}; {grasps}. {_SEEDS}:\n\n" + table(header, rows)


def _frames(out: Path, sweep: str) -> int:
    """Control steps of each training of a sweep."""
    curves = json.loads((out / f"evaluate-{sweep}" / "curves" / "curves.json").read_text("utf-8"))
    return max(run["frames"] for group in curves["groups"].values() for run in group["runs"])


def headings(names: Iterable[str]) -> list[str]:
    """What columns of these figures are called."""
    return [_ROWS[name][0] for name in names]


def figures(seeds: list[Figures], names: Iterable[str]) -> list[str]:
    """The means of an experiment over its seeds."""
    return [_mean(seeds, name, *_ROWS[name][1:]) for name in names]


def parts(out: Path) -> str:
    """What each part of the observation is worth."""
    return f"What each part of the observation is worth.\n\n{ablation(out, 'parts', _OF_SWEEPS)}"


def printed(out: Path) -> str:
    """The method as printed, in all and by softness."""
    found = {("ib, as printed" if who == "ib" else who): seeds for who, seeds in _sweep(out, "printed").items()}
    cells = read_evaluation(out / "evaluate-printed" / "softness")["cells"]
    rows = (_row(name, found, _mean) for name in (*_OF_SWEEPS, "displacement_total_mm"))
    return (
        f"{_SEEDS}:\n\n{table(['', *found], rows)}\n\nForce reward (normalised form) by softness, mean over seeds:\n\n"
        + _by_softness(found, cells)
    )


def transfer(out: Path) -> str:
    """The training simulator beside the virtual robot."""
    home, robot = columns(out, _ON_ROBOT, "objects"), columns(out, _ON_ROBOT, "robot")
    rows = [
        [
            f"`{name}`",
            _mean(home[name], REWARD, 1, 1.0),
            *(_mean(robot[name], figure, 1, 1.0) for figure in (REWARD, MEASURED)),
            _mean(robot[name], "displacement_total_mm", 2, 1.0),
            _PAPERS_ROBOT.get(name, ""),
        ]
        for name in _ON_ROBOT
    ]
    on_robot = ("robot, actual forces", "robot, measured forces", "object moved on the robot [mm]")
    header = ["", "training simulator", *on_robot, "paper, real robot"]
    return f"Normalised force reward of 150. {_SEEDS}:\n\n" + table(header, rows)


def robots(out: Path) -> str:
    """The test half of the robots that nobody measured, and each policy against the baseline."""
    sheets = islice(robot_sheets(read_evaluation(out / "robots" / "evaluation")), 2)
    return f"{LEGEND}\n\n{markdown(sheets).strip()}"


def transfer_objects(out: Path) -> str:
    """By object on the virtual robot, as in the paper's Table 1."""
    found = columns(out, [name for name in _ON_ROBOT if name != "ib_virtual_robot"], "robot")

    def cells(seeds: list[Figures]) -> list[str]:
        parts = zip(*([*one[MEASURED]["by_cell"], one[MEASURED]] for one in seeds), strict=True)
        return [" ± ".join(f"{np.mean([of[kind] for of in part]):.0f}" for kind in ("mean", "std")) for part in parts]

    rows = [[f"`{name}`", *cells(seeds)] for name, seeds in found.items()]
    rows += [[name, *text.split(", ")] for name, text in _PAPERS_OBJECTS.items()]
    told = "By object, measured forces, as in the paper's table: mean ± standard deviation of grasps"
    return f"{told}, both the mean over seeds:\n\n" + table(["", *_cells(out, "robot"), "average"], rows)
