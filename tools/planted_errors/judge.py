"""Plants one error in a copy of the checkout, and lets the tests there say whether they notice."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import re
import shutil
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from tools.planted_errors.listing import Error

CAUGHT, SURVIVED, TIMEOUT, BROKEN, STALE = "caught", "survived", "timeout", "broken", "stale"
_FAILED = re.compile(r"^(?:FAILED|ERROR) ((\S+?\.py)\S*)", re.MULTILINE)
#: What takes seconds to import and is the same for every error: processes with tests are forked from one that has it.
HEAVY = ["pytest", "numpy", "scipy.stats", "scipy.optimize", "mujoco", "torch", "torchrl.envs", "polars"]


@dataclass(frozen=True)
class Outcome:
    """What became of an error."""

    verdict: str  #: one of the above
    by: str = ""  #: the test that noticed, or why it could not be judged


def copy_checkout(root: Path, to: Path) -> None:
    """Copies what git tracks, and what is new and not ignored."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    listed = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True).stdout
    for name in filter(None, listed.split("\0")):
        if (root / name).is_file():  # one that was removed is listed, too
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(root / name, to / name)


class Judge:
    """Works in one copy of the checkout, which it leaves as it was after each error.

    Args:
      tree: the copy; files of the tests lie beside it while they run.
      timeout_s: for one run of tests.
    """

    def __init__(self, tree: Path, timeout_s: float) -> None:
        self.tree, self.timeout_s = tree, timeout_s
        self._sound: dict[str, bool] = {}
        self._processes = multiprocessing.get_context("forkserver")
        self._processes.set_forkserver_preload(HEAVY)

    def judge(self, error: Error) -> Outcome:
        """Runs the tests that are named, then, if they pass, all those in their folders."""
        if problem := error.problem(self.tree):
            return Outcome(STALE, problem)
        wider = tuple(dict.fromkeys(self._wider(test) for test in error.tests))
        outcome = Outcome(SURVIVED)
        for tests in dict.fromkeys([error.tests, wider]):
            outcome = self._try(error, tests)
            if outcome.verdict != SURVIVED:
                break
        return outcome

    def _wider(self, test: str) -> str:
        """The folder of a file of tests; but not the one of all tests."""
        folder = Path(test).parent
        return test if (self.tree / test).is_dir() or folder.name == "tests" else str(folder)

    def _try(self, error: Error, tests: tuple[str, ...]) -> Outcome:
        path = self.tree / error.file
        text = path.read_text("utf-8")
        _write(path, text.replace(error.right, error.wrong))
        try:
            status, said = self._run(tests)
        finally:
            _write(path, text)
        if status in (None, 0):
            return Outcome(SURVIVED) if status == 0 else Outcome(TIMEOUT, f"more than {self.timeout_s:g} s")
        failed = _FAILED.search(said)
        if failed is None:
            return Outcome(BROKEN, " ".join(said.split())[-200:])
        if not self._is_sound(failed[2]):
            return Outcome(BROKEN, f"{failed[2]} fails without any error, too")
        return Outcome(CAUGHT, failed[1])

    def _is_sound(self, test: str) -> bool:
        """Whether a file of tests passes with nothing planted."""
        if test not in self._sound:
            self._sound[test] = self._run((test,))[0] == 0
        return self._sound[test]

    def _run(self, tests: tuple[str, ...]) -> tuple[int | None, str]:
        """Exit status and what was said; no status if it took too long."""
        place = self.tree.with_name(f"{self.tree.name}_run")
        place.mkdir()
        process = self._processes.Process(target=_pytest, args=(self.tree, place, tests))
        process.start()
        process.join(self.timeout_s)
        if process.is_alive():
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid or 0, signal.SIGKILL)  # and what the tests have started
            process.join()
            status = None
        else:
            status = process.exitcode
        said = (place / "output").read_text("utf-8", "replace") if (place / "output").exists() else ""
        shutil.rmtree(place, ignore_errors=True)
        return status, said


def _write(path: Path, text: str) -> None:
    path.write_text(text, "utf-8")
    # what was compiled is known by size and time in whole seconds, which may be the same
    shutil.rmtree(path.parent / "__pycache__", ignore_errors=True)


def _pytest(tree: Path, place: Path, tests: tuple[str, ...]) -> None:
    """Runs tests of a tree; called in a process of its own."""
    os.setsid()
    output = os.open(place / "output", os.O_WRONLY | os.O_CREAT)
    os.dup2(output, 1)
    os.dup2(output, 2)
    os.chdir(tree)
    os.environ |= {"PYTHONPATH": str(tree), "COLUMNS": "500"}
    sys.path.insert(0, str(tree))
    sys.dont_write_bytecode = False  # what is compiled once serves many errors
    for name in [name for name in sys.modules if name.partition(".")[0] in ("forcegrasp", "tools")]:
        del sys.modules[name]  # those of the checkout
    import pytest

    options = ["-x", "-q", "--tb=no", "-rfE", "-p", "no:cacheprovider", f"--basetemp={place / 'temporary'}"]
    sys.exit(pytest.main([*options, *tests]))
