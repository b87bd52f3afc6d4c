"""What a run of the program was asked for, and which code its figures depend on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tools.measured_code import ROOT, digest

SEEDS = 5
#: Kinds of figures → the packages of forcegrasp, and the presets, whose every line can change them.
CODE: dict[str, tuple[str, ...]] = {
    "training": (
        *("assets", "conf", "config", "controllers", "curriculum", "effects", "env", "models", "observation.py"),
        *("physics", "train", "transforms", "evaluate/grids.py", "evaluate/rollouts.py", "evaluate/statistics.py"),
    ),
}
CODE["diagnosis"] = (*CODE["training"], "diagnosis", "identify", "measure", "replay")


#: What figures of a trial are marked with.
TRIAL = ", a TRIAL that says nothing"


@dataclass(frozen=True)
class Settings:
    """What was asked for.

    Args:
      out: folder of runs, evaluations and notes.
      seeds: of each training.
      frames: control steps of each training; None for the presets' own.
      trials: grasps in each cell of an evaluation; None for the pages' own.
      real_data: folder of the public recordings; without it they are left out.
    """

    out: Path = ROOT / "runs" / "results"
    seeds: int = SEEDS
    frames: int | None = None
    trials: int | None = None
    real_data: Path | None = None

    @property
    def trial(self) -> bool:
        """Whether figures come out that no page may show."""
        return self.seeds != SEEDS or self.frames is not None or self.trials is not None

    @property
    def into(self) -> Path:
        """Where pages, figures and policies are written: the repository, or for a trial a folder of its own."""
        return self.out / "pages" if self.trial else ROOT

    def shown(self, *parts: str) -> str:
        """A path of the results as commands have it, which run in the repository."""
        path = self.out.joinpath(*parts).resolve()
        return str(path.relative_to(ROOT) if path.is_relative_to(ROOT) else path)


def digests() -> dict[str, str]:
    """Of each kind, of the code as it is."""
    return {kind: digest(packages=packages) for kind, packages in CODE.items()}
