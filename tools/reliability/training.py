"""Trainings that take half a second, started in forked processes, and what must hold for what they leave behind."""

from __future__ import annotations

import csv
import os
import signal
import time
from pathlib import Path

from forcegrasp.cli.options import compose
from forcegrasp.config import TrainConfig
from forcegrasp.errors import CheckpointError
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.loop import train
from tools.reliability.child import fork

BATCHES = 8
TINY = [
    "grasp.steps=10",
    "physics.threads=1",
    "log.keep=1",
    f"ppo.total_frames={BATCHES * 20}",
    "ppo.grasps=2",
    "ppo.epochs=1",
    "ppo.minibatch=32",
    "ppo.hidden=[8]",
    "log.histograms_every=0",
    "log.figures_every=0",
    "log.video_every=0",
]


def tiny_config(every: int = 1, seed: int = 0, *more: str) -> TrainConfig:
    """Eight batches of two short grasps; a checkpoint after ``every`` batches."""
    return compose("train", [*TINY, f"log.checkpoint_every={every}", f"seed={seed}", *more])


def start(path: Path, config: TrainConfig) -> int:
    """Trains in a new run directory, in a process of its own; returns its id."""
    return fork(lambda: not train(config, RunDir.create(path, config, [])), _log(path))


def go_on(path: Path) -> int:
    """Resumes a run in a process of its own; returns its id."""

    def work() -> bool:
        run = RunDir.open(path)
        return not train(run.config(), run, resume=True)

    return fork(work, _log(path))


def _log(path: Path) -> Path:
    return path.with_name(f"{path.name}.log")


def last_words(path: Path) -> str:
    """The last line that a process training in this run directory wrote to stderr."""
    return (_log(path).read_text().strip().splitlines() or [""])[-1]


def status(process: int) -> int:
    """Waits for a process; returns its exit status, negative if a signal ended it."""
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


def kill_after(process: int, seconds: float) -> int:
    """Kills a process (kill -9) after a while, unless it has ended; returns its exit status."""
    time.sleep(seconds)
    os.kill(process, signal.SIGKILL)  # its id is ours until it is waited for
    return status(process)


def batches_logged(run: RunDir) -> int:
    """Whole rows of metrics.csv."""
    if not run.metrics_path.exists():
        return 0
    return max(run.metrics_path.read_text().count("\n") - 1, 0)


def what_was_lost(path: Path, every: int) -> str:
    """Says what is wrong with a run that was killed; "" if it can be read and no more than ``every`` batches are lost.

    A run that was killed before config.yaml was there is none yet, and can be started again under the same name.
    """
    run = RunDir(path)
    if not run.config_path.exists():
        return "has a checkpoint but no config.yaml" if list(path.rglob("*.safetensors")) else ""
    logged = batches_logged(run)
    try:
        saved = RunDir.open(path).load()[1]["batches"]
    except CheckpointError as error:
        if "no checkpoint yet" not in str(error):
            return str(error)
        saved = 0
    return f"{logged} batches logged, {saved} saved" if logged - saved > every else ""


def ending(run: RunDir) -> tuple[bytes, list[dict[str, str]]]:
    """The last checkpoint as it is on the disk (weights, optimiser, generators), and metrics.csv without speeds."""
    last = max(run.checkpoints.glob("frames_*.safetensors")).read_bytes()
    with open(run.metrics_path, newline="") as file:
        rows = [{k: v for k, v in row.items() if not k.startswith("speed/")} for row in csv.DictReader(file)]
    return last, rows
