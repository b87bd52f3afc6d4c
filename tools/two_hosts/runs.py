"""Trainings that two machines can share: long enough to be cut off, short enough to be waited for."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from forcegrasp.runs.run_dir import RunDir
from tools.reliability.training import batches_logged, ending
from tools.two_hosts.hosts import Host

BATCHES, GRASPS, STEPS = 16, 64, 150
OPTIONS = [
    f"ppo.total_frames={BATCHES * GRASPS * STEPS}",
    f"ppo.grasps={GRASPS}",
    "ppo.epochs=1",
    "physics.threads=1",
    "log.checkpoint_every=4",
    "log.histograms_every=0",
    "log.figures_every=0",
    "log.video_every=0",
]


def wait_until(reached: Callable[[], bool], what: str, patience_s: float = 300.0) -> None:
    """Waits for something.

    Raises:
      TimeoutError: if it does not come.
    """
    until = time.monotonic() + patience_s
    while not reached():
        if time.monotonic() > until:
            raise TimeoutError(f"no {what} within {patience_s:g} s")
        time.sleep(0.1)


def wait_for_batches(path: Path, count: int) -> None:
    """Waits until a training has logged so many batches."""
    wait_until(lambda: path.exists() and batches_logged(RunDir(path)) >= count, f"{count} batches in {path}")


def same_end(path: Path, other: Path) -> bool:
    """Whether two trainings ended alike wherever they ran, bit for bit: weights, optimiser, generators, metrics."""
    runs = [RunDir.open(p) for p in (path, other)]
    (tensors, _), (others, _) = (run.load() for run in runs)
    alike = tensors.keys() == others.keys() and all(tensors[name].equal(others[name]) for name in tensors)
    return alike and ending(runs[0])[1] == ending(runs[1])[1]


def seconds_collecting(path: Path) -> float:
    """How long the batches of a run took to collect in all, but for the first, which waits for what starts up."""
    import polars

    frames = polars.read_csv(RunDir(path).metrics_path)["speed/collect_frames_per_s"]
    return sum(GRASPS * STEPS / rate for rate in frames[1:])


def last_line(host: Host, log: str, folder: Path) -> str:
    """The last that a program has printed, for a table."""
    return (host.said(log).strip().splitlines() or [""])[-1].replace(str(folder), "FOLDER")


def yes(held: bool) -> str:
    """For a table: what does not hold stands out."""
    return "yes" if held else "**no**"
