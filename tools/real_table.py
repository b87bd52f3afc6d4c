"""The only real numbers of the paper, against the model: prints the analysis and draws docs/figures/real_table.png.

python tools/real_table.py [--figure docs/figures/real_table.png] [--report FILE.html]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from forcegrasp.final_force.analysis import analyse_table
from forcegrasp.measure.schema import FinalForceTable, fingerprint_of_table
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.reports.final_force import draw, lines, sections
from forcegrasp.reports.html import write_report

SOURCE = (
    "Lach et al. 2023, Towards Transferring Tactile-based Continuous Force Control Policies from Simulation to Robot,"
    " appendix, figure of the final forces f(T) of Sponge and Wood"
)
#: Final force in newtons after each commanded delta of 0.3, 0.6, …, 3.0 mm, read off the figure.
FORCE_N = {
    "sponge": (0.00, 0.10, 0.15, 0.32, 0.37, 0.47, 0.54, 0.60, 0.63, 0.81),
    "wood": (0.00, 0.13, 0.24, 0.36, 0.47, 0.54, 0.62, 0.75, 0.83, 0.94),
}


def real_table() -> FinalForceTable:
    """The table as a measurement set of kind `final_force`."""
    objects = tuple(name for name, force in FORCE_N.items() for _ in force)
    delta, force = np.tile(np.arange(1, 11) * 3e-4, len(FORCE_N)), np.concatenate(list(FORCE_N.values()))
    fingerprint = fingerprint_of_table("tiago", None, objects, delta, force)
    return FinalForceTable(
        Path("tiago_final_force"),
        "tiago_final_force",
        "tiago",
        SOURCE,
        "facts",
        None,
        objects,
        delta,
        force,
        fingerprint,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--figure", type=Path, default=Path("docs/figures/real_table.png"))
    parser.add_argument("--report", type=Path, help="also writes the HTML report")
    options = parser.parse_args()
    analysis = analyse_table(real_table(), load_gripper("tiago"))
    print("\n".join(lines(analysis)))
    draw(analysis).savefig(options.figure, dpi=140)
    if options.report:
        facts = {"set": analysis.table.name, "fingerprint": analysis.table.fingerprint, "source": SOURCE}
        write_report(options.report, "Final forces of TIAGo's gripper", analysis.reason, sections(analysis), facts)


if __name__ == "__main__":
    main()
