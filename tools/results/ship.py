"""Puts the best seed of a policy into the package: ``python -m tools.results.ship NAME RESULTS INTO``."""

from __future__ import annotations

import sys
from pathlib import Path

from tools.measured_code import ROOT
from tools.results.notes import Notes, stamps
from tools.results.policies import POLICIES
from tools.results.seeds import best_seed
from tools.results.settings import TRIAL
from tools.ship_policy import ship


def main(name: str, out: Path, into: Path) -> None:
    """Chooses, copies and writes the card."""
    policy = next(one for one in POLICIES if one.name == name)
    run, why = best_seed(policy, out)
    made = stamps(
        Notes(out).behind([f"evaluate-{name}"]) or [], f"ship-{name}", "" if into.resolve() == ROOT else TRIAL
    )
    shown = out / f"evaluate-{name}" / ("robot" if policy.of_robot else "softness")
    ship(run, name, shown, f"{policy.what} {why}", into / "forcegrasp" / "policies", made)


if __name__ == "__main__":
    main(sys.argv[1], ROOT / sys.argv[2], ROOT / sys.argv[3])
