"""Copies pictures of the results to where pages show them: ``python -m tools.results.pictures RESULTS INTO``."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from tools.measured_code import ROOT

#: Picture in the results → name in docs/figures.
PICTURES = {
    "pictures/paper/force_reward.png": "paper_softness.png",
    "pictures/paper/displacement.png": "paper_displacement.png",
    "pictures/users/force_reward.png": "force_reward.png",
    "pictures/users/overshoot.png": "overshoot.png",
    "pictures/users/traces_recommended.png": "traces_recommended.png",
    "pictures/users/traces_ib.png": "traces.png",
    "evaluate-ablation/curves/curves.png": "ablation_curves.png",
}


def main(out: Path, into: Path) -> None:
    """Copies all of them."""
    figures = into / "docs" / "figures"
    figures.mkdir(parents=True, exist_ok=True)
    for source, name in PICTURES.items():
        shutil.copy(out / source, figures / name)


if __name__ == "__main__":
    main(ROOT / sys.argv[1], ROOT / sys.argv[2])
