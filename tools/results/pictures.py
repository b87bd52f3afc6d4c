"""Copies pictures of the results to where pages show them.

python -m tools.results.pictures RESULTS INTO STAGE        those that a stage has drawn
python -m tools.results.pictures RESULTS INTO VIDEO NAME   the last picture of a video
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from PIL import Image

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
    "robots/evaluation/robots.png": "robots.png",
}


def main(out: Path, into: Path, stage: str) -> None:
    """Copies those of a stage."""
    figures = into / "docs" / "figures"
    figures.mkdir(parents=True, exist_ok=True)
    for source, name in PICTURES.items():
        if source.startswith(f"{stage}/"):
            shutil.copy(out / source, figures / name)


def last_picture(video: Path, picture: Path) -> None:
    """Where all of an episode's traces are drawn."""
    picture.parent.mkdir(parents=True, exist_ok=True)
    with Image.open(video) as moving:
        moving.seek(getattr(moving, "n_frames", 1) - 1)
        moving.convert("RGB").save(picture)


if __name__ == "__main__":
    results, target, source, *named = sys.argv[1:]
    if named:
        last_picture(ROOT / source, ROOT / target / "docs" / "figures" / named[0])
    else:
        main(ROOT / results, ROOT / target, source)
