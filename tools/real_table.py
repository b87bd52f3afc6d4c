"""The only final forces of the robot, two sessions, against the model: prints the analysis, draws its picture.

python tools/real_table.py [--figure docs/figures/real_table.png] [--report FILE.html]
"""

from __future__ import annotations

import argparse
from collections.abc import Collection
from pathlib import Path

import numpy as np

from forcegrasp.final_force.analysis import TableAnalysis, analyse_table
from forcegrasp.measure.schema import FinalForceTable, fingerprint_of_table
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.reports.final_force import draw, lines, sections
from forcegrasp.reports.html import write_report

SOURCE = (
    "Lach et al. 2023, Towards Transferring Tactile-based Continuous Force Control Policies from Simulation to Robot:"
    " experiments/data of github.com/llach/learning_fc, commits ee792cf (2023-09-09) and 7e517cf (2023-09-15)"
)
FIRST, SECOND = "2023-09-09", "2023-09-15"
#: Commanded deltas of a session, mm.
DELTA_MM = {
    FIRST: (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.5, 2.0, 2.5, 3.0),
    SECOND: (0.3, 0.6, 0.9, 1.2, 1.5, 1.8, 2.1, 2.4, 2.7, 3.0),
}
#: Final force in newtons after each of them. The second session is the appendix' figure of f(T) of Sponge and Wood.
FORCE_N = {
    (FIRST, "sponge"): (0.01, 0.06, 0.09, 0.10, 0.11, 0.16, 0.19, 0.26, 0.35, 0.50, 0.57, 0.65),
    (FIRST, "glue"): (0.037, 0.07, 0.10, 0.12, 0.15, 0.18, 0.21, 0.28, 0.37, 0.47, 0.66, 0.71),
    (FIRST, "pringles"): (0.06, 0.10, 0.13, 0.16, 0.19, 0.22, 0.28, 0.34, 0.43, 0.51, 0.65, 0.79),
    (FIRST, "wood"): (0.04, 0.075, 0.11, 0.13, 0.15, 0.19, 0.23, 0.31, 0.43, 0.58, 0.72, 0.90),
    (SECOND, "sponge"): (0.00, 0.10, 0.15, 0.32, 0.37, 0.47, 0.54, 0.60, 0.63, 0.81),
    (SECOND, "wood"): (0.00, 0.13, 0.24, 0.36, 0.47, 0.54, 0.62, 0.75, 0.83, 0.94),
}


def real_table(chosen: Collection[str] = (FIRST, SECOND)) -> FinalForceTable:
    """The rows of these sessions as a measurement set of kind `final_force`."""
    rows = [
        (session, name, 1e-3 * delta, force)
        for (session, name), forces in FORCE_N.items()
        if session in chosen
        for delta, force in zip(DELTA_MM[session], forces, strict=True)
    ]
    sessions, objects, delta, force = zip(*rows, strict=True)
    delta, force = np.array(delta), np.array(force)
    named = sessions if len(chosen) > 1 else ()
    name = "tiago_final_force"
    fingerprint = fingerprint_of_table("tiago", None, objects, delta, force, named)
    return FinalForceTable(
        Path(name), name, "tiago", SOURCE, "facts", None, objects, delta, force, fingerprint, sessions=named
    )


def print_analysis(title: str, analysis: TableAnalysis) -> None:
    """The lines that the verb prints, below a title."""
    print(f"\n{title}\n" + "\n".join(lines(analysis)))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--figure", type=Path, default=Path("docs/figures/real_table.png"))
    parser.add_argument("--report", type=Path, help="also writes the HTML report")
    options = parser.parse_args()
    gripper = load_gripper("tiago")
    for session in (FIRST, SECOND):
        print_analysis(f"{session} alone", analyse_table(real_table((session,)), gripper))
    analysis = analyse_table(real_table(), gripper)
    print_analysis("both sessions", analysis)
    draw(analysis).savefig(options.figure, dpi=140)
    if options.report:
        facts = {"set": analysis.table.name, "fingerprint": analysis.table.fingerprint, "source": SOURCE}
        write_report(options.report, "Final forces of TIAGo's gripper", analysis.reason, sections(analysis), facts)


if __name__ == "__main__":
    main()
