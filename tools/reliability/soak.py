"""A training that goes on for hours with all that it can write: its memory stays, and its files stay readable."""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from forcegrasp.cli.options import compose
from forcegrasp.runs.run_dir import RunDir
from tools.reliability.training import batches_logged, last_words, start, status
from tools.reliability.trial import Promise, Trial

#: Share of the time after which memory is held to stay, and by how much it may grow then.
WARM_UP = 0.25
MB_PER_HOUR = 20.0
SAMPLES = 120
_OPTIONS = [
    "ppo.total_frames=1000000000000",
    "ppo.grasps=16",
    "grasp.steps=50",
    "physics.threads=1",
    "log.histograms_every=5",
    "log.figures_every=20",
    "log.video_every=40",
]


def trials(minutes: int, seed: int) -> Iterator[Trial]:
    """One training of so many minutes; ``--trials`` are the minutes."""
    with tempfile.TemporaryDirectory() as folder:
        run = RunDir(Path(folder) / "run")
        process = start(run.path, compose("train", [*_OPTIONS, f"seed={seed}"]))
        began, hours, memory = time.monotonic(), [], []
        for sample in range(SAMPLES):
            time.sleep(max(began + (sample + 1) * 60 * minutes / SAMPLES - time.monotonic(), 0))
            if os.waitpid(process, os.WNOHANG)[0]:
                yield Trial("the training goes on", f"it ended: {last_words(run.path)}")
                return
            hours.append((time.monotonic() - began) / 3600)
            memory.append(_memory_mb(process))
        os.kill(process, signal.SIGTERM)
        ended = status(process)
        yield Trial("it ends when asked to", "" if ended == 1 else f"exit status {ended}: {last_words(run.path)}")
        late = np.array(hours) > WARM_UP * hours[-1]
        slope = float(np.polyfit(np.array(hours)[late], np.array(memory)[late], 1)[0])
        said = f"{memory[0]:.0f} MB at first, {memory[-1]:.0f} MB after {hours[-1]:.2f} h, {slope:+.1f} MB an hour"
        yield Trial("memory stays", said if slope > MB_PER_HOUR else "", f"(memory: {said})")
        batches, saved = batches_logged(run), run.load()[1]["batches"]
        yield Trial("all is saved", "" if saved == batches else f"{saved} of {batches} batches")
        for what, pattern in (("events", "tensorboard/*"), ("figures", "figures/*"), ("checkpoints", "checkpoints/*")):
            files = list(run.path.glob(pattern))
            size = sum(path.stat().st_size for path in files) / 1e6
            yield Trial(
                f"{what} are there", "" if files else "there are none", f"({what}: {len(files)} files, {size:.1f} MB)"
            )
        left = [path.name for path in run.checkpoints.iterdir()]
        yield Trial("old checkpoints go", "" if len(left) <= 4 else f"{len(left)} are left", f"({batches} batches)")


def _memory_mb(process: int) -> float:
    """Resident memory of a process, MB."""
    said = subprocess.run(["ps", "-o", "rss=", "-p", str(process)], capture_output=True, text=True, check=True)
    return int(said.stdout) / 1e3


PROMISE = Promise("a training that goes on for hours keeps its memory and its files in order", 120, 0, trials)
