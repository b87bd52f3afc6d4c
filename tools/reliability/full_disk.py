"""A disk that becomes full at a random point of a training: nothing that was saved is lost, and one line says so."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from forcegrasp.cli.main import main
from tools.reliability.child import fork
from tools.reliability.training import TINY, go_on, last_words, start, status, tiny_config, what_was_lost
from tools.reliability.trial import Promise, Trial

DISK = 4_000_000
FIGURES = ["log.figures_every=3", "log.histograms_every=2"]


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Each trains until the disk is full, reads what is left, makes room, and goes on to the end."""
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as name, _disk(Path(name)) as fill:
        folder, failed, number = Path(name), 0, 0
        whole = folder / "whole"
        assert status(start(whole, tiny_config(1, 0, *FIGURES))) == 0, last_words(whole)
        needed = sum(path.stat().st_size for path in whole.rglob("*") if path.is_file())
        _remove(whole)
        while failed < count:
            number += 1
            path, every = folder / "run", int(rng.integers(1, 4))
            options = [*TINY, f"log.checkpoint_every={every}", *(FIGURES if number % 2 else [])]
            free = int(rng.integers(0, needed))
            ended, said = _train(path, options, lambda free=free: fill(free))
            if ended != 0:  # else there was room for all
                failed += 1
                problem = _problem(path, every, ended, said)
                yield Trial(f"{number}: {free:,} bytes free, checkpoint_every={every}", problem, _what(said))
            _remove(path)


def _train(path: Path, options: list[str], fill: Callable[[], None]) -> tuple[int, str]:
    """Trains from the command line with a disk that is nearly full; returns exit status and what stderr said."""
    read, write = os.pipe()  # not a file, for which there might be no room

    def work() -> int:
        os.dup2(write, 2)
        sys.stderr = os.fdopen(2, "w", 1, closefd=False)  # the one before may be of a file, which can seek
        fill()
        return main(["train", *options, f"hydra.run.dir={path}"])

    process = fork(work)
    os.close(write)
    with open(read, encoding="utf-8") as pipe:
        said = pipe.read()
    ended = status(process)
    path.with_name("ballast").unlink(missing_ok=True)
    return ended, said


def _problem(path: Path, every: int, ended: int, said: str) -> str:
    if ended != 2 or not said.startswith("forcegrasp: ") or said.count("\n") != 1:
        return f"exit status {ended}, said {said[-400:]!r}"
    if lost := what_was_lost(path, every):
        return lost
    if list(path.glob("checkpoints/frames_*.safetensors")) and status(go_on(path)):
        return f"could not be resumed: {last_words(path)}"
    return ""


def _what(said: str) -> str:
    """What could not be written."""
    for part in ("could not save the checkpoint", "could not make the run directory", "could not write"):
        if part in said:
            return part
    return "something else"


def _remove(path: Path) -> None:
    subprocess.run(["rm", "-rf", str(path)], check=True)


@contextmanager
def _disk(folder: Path) -> Iterator[Callable[[int], None]]:
    """Makes the folder a small disk, and yields what leaves so many bytes free on it.

    Who may not mount one gets a limit on the size of files, in the process that asks for it.
    """

    def fill(free: int) -> None:
        facts = os.statvfs(folder)
        size = max(facts.f_bavail * facts.f_frsize - free, 0)
        with open(folder / "ballast", "wb") as file:
            os.posix_fallocate(file.fileno(), 0, size)

    def limit(free: int) -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (free // 8, free // 8))  # of one file

    command = ["mount", "-t", "tmpfs", "-o", f"size={DISK}", "tmpfs", str(folder)]
    mounted = sys.platform == "linux" and not subprocess.run(command, capture_output=True, check=False).returncode
    try:
        yield fill if mounted else limit
    finally:
        if mounted:
            subprocess.run(["umount", "-l", str(folder)], check=True)


PROMISE = Promise(
    "a disk that fills up while training costs one checkpoint interval at most, and one line says so", 100, 1, trials
)
