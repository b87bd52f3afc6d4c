"""Hostile files: nothing in them is executed, nothing is written elsewhere, time and memory are bounded."""

from __future__ import annotations

import importlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from forcegrasp.errors import ForcegraspError
from tools.reliability.attacks.attack import MARK, Attack
from tools.reliability.child import each, peak_memory_mb
from tools.reliability.trial import Promise, Trial

MODULES = ("yaml_files", "runs", "sets", "scenes", "command_line")
#: More than the process had before, MB.
MEMORY_MB = 1000


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Every attack there is; or so many of them, spread over all, if ``count`` is smaller."""
    del seed  # there is nothing random about them
    listed = [
        (f"{module}: {attack.name}"[:160], attack)
        for module in MODULES
        for attack in importlib.import_module(f"tools.reliability.attacks.{module}").attacks()
    ]
    listed = listed[:: max(len(listed) // count, 1)] if count else listed
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        (root / "outside").mkdir()
        (root / "outside" / "secret").write_text("secret")
        for name, attack in listed:
            # a process for each, lest the memory that one took be blamed on the next
            ((_, answer, problem),) = each([attack], lambda attack: _attempt(attack, root), attack.seconds)
            how, complaint = answer or ("did not end well", "")
            yield Trial(name, problem or complaint or _harm(root), f"{name.partition(':')[0]}: {how}")


def _attempt(attack: Attack, root: Path) -> tuple[str, str]:
    """Lays the files out, has the victim read them; returns how it went and what is wrong with that."""
    case = root / "case"
    shutil.rmtree(case, ignore_errors=True)
    case.mkdir()
    os.chdir(case)
    attack.lay()
    laid = _tree(case)
    before = peak_memory_mb()
    try:
        attack.fall_for()
        how, wrong = "read", "was not refused" if attack.refused else ""
    except ForcegraspError as error:
        how, text = "refused", str(error)
        wrong = "" if text.splitlines() == [text] and len(text) < 1000 else f"not one short line: {text[:300]!r}"
    except OSError as error:  # which the command line reports in one line, too
        how, wrong = "refused", "" if error.strerror else f"not one line: {error}"
    grown = peak_memory_mb() - before
    new = [path for path in _tree(case) - laid if path.parts[0] != "out"]
    if new:
        wrong = wrong or f"wrote {', '.join(map(str, new[:3]))}"
    if grown > MEMORY_MB:
        wrong = wrong or f"took {grown:.0f} MB"
    return how, wrong


def _tree(folder: Path) -> set[Path]:
    return {path.relative_to(folder) for path in folder.rglob("*")}


def _harm(root: Path) -> str:
    """What is there that should not be, or no longer."""
    if list(root.rglob(MARK)):
        return "was executed"
    there = {path.name for path in (*root.iterdir(), *(root / "outside").iterdir())}
    if there != {"case", "outside", "secret"} or (root / "outside" / "secret").read_text() != "secret":
        return f"wrote outside: {sorted(there)}"
    return ""


PROMISE = Promise("no file executes anything, writes elsewhere, or takes much time or memory", 0, 12, trials)
