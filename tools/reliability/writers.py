"""Two processes that want to train in one run directory at the same time."""

from __future__ import annotations

import signal
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from forcegrasp.cli.main import main
from forcegrasp.cli.options import compose
from forcegrasp.runs.run_dir import RunDir
from tools.reliability.child import fork
from tools.reliability.training import TINY, ending, kill_after, status
from tools.reliability.trial import Promise, Trial

REFUSED = " is training here; wait until it has ended, or end it"


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Each types a training twice at once, kills it, types ``resume=`` twice at once, and looks at what came out."""
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        compose("train", [])  # imports once what every process would
        whole = RunDir(Path(folder) / "whole")
        started = time.monotonic()
        assert status(_type(whole, 0, resume=False)) == 0
        seconds = time.monotonic() - started
        for number in range(count):
            run, delay = RunDir(Path(folder) / f"{number}"), float(rng.uniform(0.4, 1.4) * seconds)
            begun = [_type(run, writer, resume=False) for writer in (1, 2)]
            statuses = {writer: kill_after(begun[writer - 1], delay * (2 - writer)) for writer in (1, 2)}
            problem = _wrong(run, statuses)
            began, saved = run.config_path.exists(), run.has_checkpoint
            again = {writer: _type(run, writer, resume=began) for writer in (1, 2)}
            statuses = {writer: status(process) for writer, process in again.items()}
            problem = problem or _wrong(run, statuses)
            if 0 not in statuses.values():
                problem = problem or "neither went on"
            elif not problem and ending(run) != ending(whole):
                problem = "checkpoint or metrics differ"
            refused = "one of two is refused" if 2 in statuses.values() else "the second came when the first was done"
            kind = f"{'resumed' if saved else 'begun again'}: {refused}"
            yield Trial(f"{number}: killed after {delay:.3f} s", problem, kind)


def _type(run: RunDir, writer: int, resume: bool) -> int:
    """Starts one of two commands for a run, in a process of its own; returns its id."""
    begin = [*TINY, "log.checkpoint_every=2", f"hydra.run.dir={run.path}"]
    return fork(lambda: main(["train", *([f"resume={run.path}"] if resume else begin)]), _log(run, writer))


def _log(run: RunDir, writer: int) -> Path:
    return run.path.with_name(f"{run.path.name} {writer}.log")


def _wrong(run: RunDir, statuses: dict[int, int]) -> str:
    """What is wrong with how commands ended, other than well, by a kill, or refused in one line that says why."""
    for writer, ended in statuses.items():
        said = _log(run, writer).read_text()
        refused = ended == 2 and said.count("\n") == 1 and said.endswith(f"{REFUSED}\n")
        if not refused and ended not in (0, -signal.SIGKILL):
            return f"exit status {ended}: {said.strip()}"
    return ""


PROMISE = Promise("of two that train in one run directory at once, one is refused, and the run is whole", 50, 2, trials)
