"""A stage: commands, what they need, and how long they take."""

from __future__ import annotations

import sys
import sysconfig
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Stage:
    """One part of the work, which is done once.

    Args:
      makes: what comes out, in a few words.
      commands: run in the repository, in turn. Those of a training go on with what there is when they are run again.
      needs: stages that must be done before.
      code: the kind of figures, a key of ``CODE``.
      trained: control steps of its trainings.
      evaluated: control steps of its evaluations, on the reference tier.
      hours: of the rest.
      writes_docs: it writes into the repository by itself, and is left out of trials.
    """

    name: str
    makes: str
    commands: tuple[tuple[str, ...], ...]
    needs: tuple[str, ...] = ()
    code: str = "training"
    trained: int = 0
    evaluated: int = 0
    hours: float = 0.0
    writes_docs: bool = False


def ready_to_run(command: tuple[str, ...]) -> list[str]:
    """The command with the present Python and its programs."""
    program, *words = command
    found = sys.executable if program == "python" else str(Path(sysconfig.get_path("scripts")) / program)
    return [found, *words]
