"""An evaluation as tables on the terminal, narrow enough for one."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

#: Figures that are printed: name, heading, digits.
FIGURES = (
    ("force_reward_normalised", "force reward, normalised form", 1),
    ("force_reward_paper", "force reward, paper's form", 1),
    ("force_reward_measured", "normalised form, of measured forces", 1),
    ("displacement_until_grasped_mm", "object moved until both touch, mm", 3),
    ("displacement_total_mm", "object moved in all, mm", 3),
    ("fast_steps", "steps over the speed threshold", 2),
    ("overshoot_percent", "largest overshoot, % of the goal", 1),
    ("reach_s", "time until within 2 σ_f of the goal, s", 2),
    ("final_force_error_n", "force error over the last second, N", 4),
)


def print_report(report: dict, console: Console) -> None:
    """All cells together, then cell by cell, then how likely each policy beats the baseline."""
    policies = report["policies"]
    _overall(report, policies, console)
    for figure, heading, digits in FIGURES[:5]:
        table = _table(f"{heading}: mean ± half of its 95 % interval", report["what"], policies)
        for index, cell in enumerate(report["cells"]):
            found = [values[figure]["by_cell"][index] for values in policies.values()]
            table.add_row(cell, *(f"{c['mean']:.{digits}f} ± {(c['high'] - c['low']) / 2:.{digits}f}" for c in found))
        console.print(table)
    if report["baseline"]:
        others = [name for name in policies if name != report["baseline"]]
        table = _table(f"probability of being better than {report['baseline']} [95 % interval]", "figure", others)
        for figure, heading, _ in FIGURES[:5]:
            found = [policies[name][figure]["improvement"] for name in others]
            table.add_row(heading, *(f"{p['probability']:.2f} [{p['low']:.2f}, {p['high']:.2f}]" for p in found))
        console.print(table)


def _overall(report: dict, policies: dict, console: Console) -> None:
    title = f"mean ± standard deviation and interquartile mean [its 95 % interval], episodes of {report['steps']} steps"
    table = _table(title, "figure", policies)
    for figure, heading, digits in FIGURES:
        cells = [values[figure] for values in policies.values()]
        table.add_row(
            heading,
            *(
                f"{c['mean']:.{digits}f} ± {c['std']:.{digits}f}\n"
                f"{c['iqm']:.{digits}f} [{c['iqm_low']:.{digits}f}, {c['iqm_high']:.{digits}f}]"
                for c in cells
            ),
        )
    console.print(table)


def _table(title: str, first: str, policies: object) -> Table:
    table = Table(title=title)
    table.add_column(first)
    for name in policies:
        table.add_column(name, justify="right", overflow="fold")
    return table
