"""An evaluation as tables, for the terminal and as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from forcegrasp.evaluate.statistics import QUANTILES

_MEASURED = ("force_reward_measured", "normalised form, of measured forces", 1)
#: Metrics that are shown: name, heading, digits. The first ones, _BY_CELL, also cell by cell.
METRICS = (
    ("force_reward_normalised", "force reward, normalised form", 1),
    ("force_reward_paper", "force reward, paper's form", 1),
    _MEASURED,
    ("displacement_until_grasped_mm", "object moved until both touch, mm", 3),
    ("displacement_total_mm", "object moved in all, mm", 3),
    ("overshoot_percent", "largest overshoot, % of the goal", 1),
    ("overshoot_n", "largest overshoot, N", 3),
    ("displacement_after_grasped_mm", "object moved after both touch, mm", 3),
    ("fast_steps", "steps over the speed threshold", 2),
    ("peak_force_n", "peak force, N", 3),
    ("impact_impulse_ns", "impact impulse beyond the goal, N s", 4),
    ("reach_s", "time until within 2 σ_f of the goal, s", 2),
    ("settled_s", "time from which within 2 σ_f of it, s", 2),
    ("final_force_error_n", "force error over the last second, N", 4),
    ("final_force_difference_n", "difference between the fingers over the last second, N", 4),
    ("command_effort", "effort of the commands, m or rad", 5),
    ("action_change", "change of the actions", 2),
    ("crushed_percent", "crushed (> 1.5 × goal for > 40 ms), % of the grasps", 1),
    ("lost_percent", "lost (not held throughout the last second), % of the grasps", 1),
)
_BY_CELL = 7
#: Metrics that are 0 or 100, of which quantiles say nothing.
SHARES = ("crushed_percent", "lost_percent")
#: Columns of a terminal in which numbers of the short table need not be folded.
NARROW = 80


@dataclass(frozen=True)
class Sheet:
    """A table before it is drawn."""

    title: str
    header: list[str]
    rows: list[list[str]]

    def in_lines(self) -> tuple[list[str], list[list[str]]]:
        """Header and rows without line breaks in their cells."""
        header = [name.replace("-\n", "").replace("\n", " ") for name in self.header]
        return header, [[cell.replace("\n", "; ") for cell in row] for row in self.rows]


def print_sheet(sheet: Sheet, console: Console) -> None:
    """Shows a table; what is too wide is folded, never cut off."""
    table = Table(title=escape(sheet.title))
    _fill(table, sheet)
    console.print(table)


def print_short(sheet: Sheet, console: Console) -> None:
    """Shows a table whose numbers fit; of its names, long ones are folded."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), show_edge=False)
    _fill(table, sheet, no_wrap=console.width >= NARROW)
    console.print(table)


def _fill(table: Table, sheet: Sheet, no_wrap: bool = False) -> None:
    for index, name in enumerate(sheet.header):
        number = index > 0
        table.add_column(
            escape(name), justify="right" if number else "left", overflow="fold", no_wrap=number and no_wrap
        )
    for row in sheet.rows:
        table.add_row(*map(escape, row))


def markdown(shown: Iterable[Sheet]) -> str:
    """Tables as text to paste into a document; those without rows are left out."""
    parts = []
    for sheet in filter(lambda sheet: sheet.rows, shown):
        header, rows = sheet.in_lines()
        lines = [header, ["---"] * len(header), *rows]
        parts.append(f"{sheet.title}\n\n" + "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n")
    return "\n".join(parts)


def sheets(report: dict) -> Iterator[Sheet]:
    """All cells together, cell by cell, and how likely the baseline is beaten; of objects also the paper's table."""
    policies = report["policies"]
    names = list(policies)
    # without a model the sensors say what is true
    shown = [metric for metric in METRICS if metric != _MEASURED or report["model"]]
    first = [metric for metric in shown if metric in METRICS[:_BY_CELL]]
    yield Sheet(
        f"mean ± standard deviation; interquartile mean [its 95 % interval]; episodes of {report['steps']} steps",
        ["figure", *names],
        [[heading, *(_overall(policies[name][metric], digits) for name in names)] for metric, heading, digits in shown],
    )
    yield Sheet(
        "mean ± half of its 95 % interval; median; 95th percentile, each with its 95 % interval",
        ["figure", *names],
        [
            [heading, *(_spread(policies[name][metric], digits, metric in SHARES) for name in names)]
            for metric, heading, digits in shown
            if not metric.endswith(("_normalised", "_paper", "_measured"))
        ],
    )
    for metric, heading, digits in first:
        cells = {name: policies[name][metric]["by_cell"] for name in names}
        yield Sheet(
            f"{heading}: mean ± half of its 95 % interval",
            [report["what"], *names],
            [
                [cell, *(half_interval(cells[name][index], digits) for name in names)]
                for index, cell in enumerate(report["cells"])
            ],
        )
    if report["what"] == "object":
        yield _as_in_the_paper(report)
    others = [name for name in names if name != report["baseline"]]
    if report["baseline"] and others:
        yield Sheet(
            f"probability of being better than {report['baseline']} [95 % interval]",
            ["figure", *others],
            [
                [heading, *(_probability(policies[name][metric]["improvement"]) for name in others)]
                for metric, heading, _ in first
            ],
        )


def _as_in_the_paper(report: dict) -> Sheet:
    """Rows and columns of the paper's Table 1."""
    rows = []
    for name, metrics in report["policies"].items():
        for label, metric in (("reward", "force_reward_measured"), ("moved, mm", "displacement_total_mm")):
            found = [*metrics[metric]["by_cell"], metrics[metric]]
            rows.append([f"{name}: {label}", *(f"{c['mean']:.1f} ± {c['std']:.1f}" for c in found)])
    return Sheet(
        "as in the paper's Table 1: mean ± standard deviation, reward of measured forces",
        ["method", *report["cells"], "average"],
        rows,
    )


def _overall(found: dict, digits: int) -> str:
    return (
        f"{found['mean']:.{digits}f} ± {found['std']:.{digits}f}\n"
        f"{found['iqm']:.{digits}f} [{found['iqm_low']:.{digits}f}, {found['iqm_high']:.{digits}f}]"
    )


def _spread(found: dict, digits: int, share: bool) -> str:
    quantiles = (
        f"{found[name]:.{digits}f} [{found[f'{name}_low']:.{digits}f}, {found[f'{name}_high']:.{digits}f}]"
        for name in (() if share else QUANTILES)
    )
    return "\n".join((half_interval(found, digits), *quantiles))


def half_interval(found: dict, digits: int) -> str:
    """A mean and half of its 95 % interval."""
    return f"{found['mean']:.{digits}f} ± {(found['high'] - found['low']) / 2:.{digits}f}"


def _probability(found: dict) -> str:
    return f"{found['probability']:.2f} [{found['low']:.2f}, {found['high']:.2f}]"
