"""An evaluation on a population of robots as sentences, tables and a page."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator
from pathlib import Path

from matplotlib.figure import Figure
from rich.console import Console

from forcegrasp.evaluate.robot_statistics import MARGIN, PAPERS_ORDER
from forcegrasp.evaluate.tables import Sheet, half_interval, print_sheet, print_short
from forcegrasp.reports.html import Picture, Section, Table, Text, write_report

REWARD, MEASURED = "force_reward_normalised", "force_reward_measured"
#: Metrics of the population's table: heading, name, digits.
_SHOWN = (
    ("force\nreward", REWARD, 1),
    ("reward,\nmeasured", MEASURED, 1),
    ("moved\n[mm]", "displacement_total_mm", 2),
    ("over-\nshoot", "overshoot_percent", 0),
    ("crushed\n[%]", "crushed_percent", 1),
    ("lost\n[%]", "lost_percent", 1),
)
LEGEND = (
    "Means over robots of the test half, ± half of their 95 % interval. Force reward: of the forces that act; measured:"
    " of what the sensors say, before noise. Moved: in all. Overshoot: in % of the goal. Crushed: > 1.5 × goal for"
    " > 40 ms. Worst: the robot with the least force reward."
)
#: Force rewards, by whose forces.
_KINDS = ((REWARD, "actual"), (MEASURED, "measured"))
#: Lines of the table of effects for a pair of policies.
_MOST = 8


def print_robots(report: dict, console: Console, detail: bool) -> None:
    """Prints sentences and the population's table, and with ``detail`` all other tables."""
    for sentence in robot_sentences(report):
        console.print(sentence, highlight=False, markup=False)
    first, against, *others = robot_sheets(report)
    print_short(first, console)
    console.print(LEGEND, highlight=False, markup=False)
    if against.rows:
        console.print(against.title, highlight=False, markup=False)
        print_short(against, console)
    for sheet in filter(lambda sheet: sheet.rows, others if detail else ()):
        print_sheet(sheet, console)


def write_robots_page(path: Path, report: dict, figure: Figure) -> Path:
    """Writes the evaluation as one HTML file.

    Raises:
      ConfigError: if it can't be written.
    """
    said, (first, *others) = robot_sentences(report), robot_sheets(report)
    others = [sheet for sheet in others if sheet.rows]
    caption = "Above: every robot, by what the policies get on it. Below: how much more than the baseline, sorted."
    sections = [
        Section("In short", [Table(*first.in_lines()), Text(LEGEND), *map(Text, said[1:])]),
        Section("Robot by robot", [Picture(figure, caption)]),
        *(Section(sheet.title, [Table(*sheet.in_lines())]) for sheet in others),
    ]
    facts = {
        name: str(report[name]) for name in ("seed", "robots", "trials", "steps", "physics", "gripper", "baseline")
    }
    return write_report(path, f"Policies on robots: {', '.join(report['policies'])}", said[0], sections, facts)


def robot_sentences(report: dict) -> list[str]:
    """What was done, who is never worse than the baseline, and how often the paper's order holds."""
    grasps, test = report["robots"] * report["trials"], len(report["halves"]["test"])
    found = [
        f"{report['robots']} robots with gripper {report['gripper']} × {report['trials']} grasps = {grasps}, the same"
        f" for every policy. Test half: the {test} robots of odd numbers. Simulated: physics={report['physics']}."
    ]
    for metric, kind in _KINDS if report["baseline"] else ():
        never = [one["one"] for one in _against_baseline(report, metric) if not one["beyond_margin"]]
        found.append(
            f"By {kind} forces never more than {MARGIN:g} points worse than {report['baseline']} on a robot of the test"
            f" half: {', '.join(never) or 'none'}."
        )
    for metric, kind in _KINDS if report["order"] else ():
        shares = ", ".join(f"{100 * share:.0f} % ({half})" for half, share in report["order"][metric].items())
        found.append(f"The paper's order {' > '.join(PAPERS_ORDER)} holds by {kind} forces on {shares} of the robots.")
    first = next(iter(report["policies"]))
    for one in report["effects"]:
        if one["certain"] and (one["one"], one["metric"]) == (first, REWARD):
            found.append(
                f"{one['effect']} changes the lead of {first} over {one['other']} by {one['change']:+.1f} points of"
                f" actual forces, to {one['with']:+.1f}."
            )
    if "table1" in report:
        near = report["table1"]
        first, median = near["nearest"][0], statistics.median(near["distances"])
        found.append(
            f"The paper's Table 1: nearest is robot {first}, {near['distances'][first]:.2f} standard deviations of the"
            f" paper's trials away (median {median:.2f}); {near['within_one']} are within 1."
        )
    return found


def _against_baseline(report: dict, metric: str) -> list[dict]:
    """How the others differ from the baseline on the test half."""
    wanted = {"other": report["baseline"], "metric": metric, "half": "test"}
    return [one for one in report["differences"] if wanted.items() <= one.items()]


def robot_sheets(report: dict) -> Iterator[Sheet]:
    """The population, differences, effects that make them, and every robot."""
    policies, tested = report["policies"], len(report["halves"]["test"])
    yield _population(report, "test", half_interval, _mean)
    yield Sheet(
        f"Less {report['baseline']}, paired by robot, test half; worst robot; on how many more than {MARGIN:g} worse",
        ["policy", *(cell for _, kind in _KINDS for cell in (f"by\n{kind}", "worst\n(robot)", f"worse\nof {tested}"))],
        list(_baseline_rows(report)) if report["baseline"] else [],
    )
    yield _population(report, "test", half_interval, half_interval)
    yield _population(report, "development", half_interval, half_interval)
    yield Sheet(
        "Differences between policies, paired by robot: one less the other",
        ["one", "other", "metric", "half", "mean [95 % interval]", "better on", "worst", "on robot"],
        [
            [
                *(one[key] for key in ("one", "other", "metric", "half")),
                _interval(one, "mean"),
                f"{100 * one['better_share']:.0f} %",
                f"{one['worst']:+.1f}",
                str(one["worst_robot"]),
            ]
            for one in report["differences"]
        ],
    )
    yield Sheet(
        f"What effects do to the difference of two policies, {_MOST} largest changes a pair, all robots (* even if"
        " all effects are judged at once)",
        ["one", "other", "metric", "effect", "robots", "with it", "without", "change [95 % interval]"],
        list(_effect_rows(report["effects"])),
    )
    if "table1" in report:
        shares = (
            f"Robots nearest to the paper's Table 1 ({len(report['table1']['nearest'])}), and the others: who has what"
        )
        yield Sheet(
            f"{shares} (* even if all effects are judged at once)",
            ["effect", "nearest", "others", "p (Fisher)"],
            [
                [
                    one["effect"],
                    *(f"{100 * one[group]:.0f} %" for group in ("nearest", "others")),
                    f"{one['p']:.3f}" + " *" * one["certain"],
                ]
                for one in report["table1"]["common"][:_MOST]
            ],
        )
    yield Sheet(
        "Force reward robot by robot: of actual forces (of measured forces)",
        ["robot", "half", *policies, "effects"],
        [
            [str(one["robot"]), one["half"]]
            + [f"{one['means'][name][REWARD]:.0f} ({one['means'][name][MEASURED]:.0f})" for name in policies]
            + [", ".join(dict.fromkeys(part.split(".")[0] for part in one["parts"] if "." in part))]
            for one in report["per_robot"]
        ],
    )


def _population(report: dict, half: str, rewards: Callable, others: Callable) -> Sheet:
    rows = []
    for name, metrics in report["policies"].items():
        said = [
            (rewards if metric.startswith("force_reward") else others)(metrics[metric][half], digits)
            for _, metric, digits in _SHOWN
        ]
        rows.append([name, *said, f"{metrics[REWARD][half]['lowest']:.0f}"])
    return Sheet(f"The {half} half", ["policy", *(heading for heading, *_ in _SHOWN), "worst"], rows)


def _mean(found: dict, digits: int) -> str:
    return f"{found['mean']:.{digits}f}"


def _baseline_rows(report: dict) -> Iterator[list[str]]:
    kinds = [_against_baseline(report, metric) for metric, _ in _KINDS]
    for pair in zip(*kinds, strict=True):
        cells = [
            (
                f"{one['mean']:+.1f} ± {(one['high'] - one['low']) / 2:.1f}",
                f"{one['worst']:+.0f} ({one['worst_robot']})",
                str(one["beyond_margin"]),
            )
            for one in pair
        ]
        yield [pair[0]["one"], *cells[0], *cells[1]]


def _effect_rows(effects: list[dict]) -> Iterator[list[str]]:
    shown: dict[tuple[str, ...], int] = {}
    for one in effects:
        pair = one["one"], one["other"], one["metric"]
        shown[pair] = shown.get(pair, 0) + 1
        if shown[pair] <= _MOST:
            change = _interval(one, "change") + (" *" if one["certain"] else "")
            yield [*pair, one["effect"], str(one["robots"]), f"{one['with']:+.1f}", f"{one['without']:+.1f}", change]


def _interval(found: dict, middle: str) -> str:
    return f"{found[middle]:+.2f} [{found['low']:+.2f}, {found['high']:+.2f}]"
