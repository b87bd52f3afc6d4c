"""Sweeps that are killed (kill -9) and resumed with ``train -m resume=FOLDER``, against one that nobody touched."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from forcegrasp.cli import sweep as sweeps
from forcegrasp.cli.main import main
from forcegrasp.cli.resumed_sweep import RECORD
from forcegrasp.runs.run_dir import RunDir
from tools.reliability.child import fork
from tools.reliability.training import TINY, ending, kill_after, last_words, status
from tools.reliability.trial import Promise, Trial

RUNS = ("ib_s0_0", "no_ib_s0_1", "ib_s1_2", "no_ib_s1_3")
SWEEP = ["seed=0,1", "experiment=ib,no_ib", *TINY, "log.checkpoint_every=2"]


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Each kills a sweep up to three times, and goes on with it; all of its runs must end like the undisturbed ones."""
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        whole, started = Path(folder) / "whole", time.monotonic()
        assert status(_again(whole)) == 0
        seconds = time.monotonic() - started
        for number in range(count):
            broken, kills = Path(folder) / f"broken {number}", 0
            for _ in range(rng.integers(1, 4)):
                kills += kill_after(_again(broken), float(rng.uniform(0.1, 1) * seconds)) < 0
            if ended := status(_again(broken)):
                problem = f"exit status {ended}: {last_words(broken)}"
            else:
                differ = [run for run in RUNS if ending(RunDir(whole / run)) != ending(RunDir(broken / run))]
                problem = f"differ: {', '.join(differ)}" if differ else ""
            yield Trial(f"seed {seed}, {number}: {kills} kills", problem, f"{kills} kills")


def _again(folder: Path) -> int:
    """Begins a sweep, or goes on with it, in a process of its own; returns its id. Its learning curves are left out."""
    options = [f"resume={folder}"] if (folder / RECORD).exists() else [*SWEEP, f"hydra.sweep.dir='{folder}'"]

    def work() -> int:
        sweeps._draw_curves = lambda folder: None  # they would take longer than all of its trainings
        return main(["train", "-m", *options])

    return fork(work, folder.with_name(f"{folder.name}.log"))


PROMISE = Promise(
    "a sweep that is killed goes on with resume=, and each run ends like an undisturbed one", 50, 1, trials
)
