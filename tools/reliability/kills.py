"""kill -9 at random instants of a training, half of them inside a save."""

from __future__ import annotations

import os
import signal
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from forcegrasp.config import TrainConfig
from forcegrasp.files import whole_file
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.loop import train
from tools.reliability.child import fork
from tools.reliability.training import BATCHES, go_on, kill_after, last_words, start, status, tiny_config, what_was_lost
from tools.reliability.trial import Promise, Trial

#: Where in the writing of a file the process dies.
PLACES = ("write", "flush", "before the rename", "after the rename", "removing an old one")


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Each kills a training, reads what is left, and goes on with it to its end."""
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        started = time.monotonic()
        assert status(start(Path(folder) / "whole", tiny_config())) == 0
        seconds, number, killed = time.monotonic() - started, 0, 0
        while killed < count:
            number += 1
            path, every = Path(folder) / f"{number}", int(rng.integers(1, 4))
            if killed % 2 == 0:  # it is that many before this one
                place, nth, share = str(rng.choice(PLACES)), int(rng.integers(1, BATCHES // every)), float(rng.random())
                name = f"{number}: inside a save: {place} {nth}, checkpoint_every={every}"
                ended = status(die_inside(path, tiny_config(every), place, nth, share))
            else:
                delay = float(rng.uniform(0, seconds))
                name = f"{number}: after {delay:.3f} s, checkpoint_every={every}"
                ended = kill_after(start(path, tiny_config(every)), delay)
            if ended == 0:
                continue  # it was done before
            killed += 1
            problem = what_was_lost(path, every)
            if not problem and ended != -signal.SIGKILL:
                problem = f"exit status {ended}: {last_words(path)}"
            if not problem and (path / "config.yaml").exists() and status(go_on(path)):
                problem = f"could not be resumed: {last_words(path)}"
            yield Trial(name, problem, f"killed {'inside a save' if killed % 2 else 'at an instant'}")


def die_inside(path: Path, config: TrainConfig, place: str, nth: int, share: float) -> int:
    """Starts a training that kills itself at the nth time it comes to a place in the writing of a file."""

    def work() -> int:
        _arm(place, nth, share)
        run = RunDir.create(path, config, [])
        return int(not train(config, run))

    return fork(work, path.with_name(f"{path.name}.log"))


def _arm(place: str, nth: int, share: float) -> None:
    left = nth

    def countdown() -> bool:
        nonlocal left
        left -= 1
        return left == 0

    def die() -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    class Torn:
        """A file whose nth write is cut short."""

        def __init__(self, path: Path, mode: str) -> None:
            self.file = open(path, mode)  # noqa: SIM115

        def __enter__(self) -> Torn:
            return self

        def __exit__(self, *_: Any) -> None:
            self.file.close()

        def __getattr__(self, name: str) -> Any:
            return getattr(self.file, name)

        def write(self, data: bytes) -> None:
            if countdown():
                os.write(self.file.fileno(), data[: int(share * len(data))])
                die()
            self.file.write(data)

    def before(function: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *given, **named: die() if countdown() else function(*given, **named)

    def after(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*given: Any, **named: Any) -> Any:
            result = function(*given, **named)
            if countdown():
                die()
            return result

        return call

    # This process ends soon: nothing is put back.
    if place == "write":
        whole_file.open = Torn  # pyright: ignore[reportAttributeAccessIssue]
    elif place == "flush":
        os.fsync = before(os.fsync)
    elif place == "before the rename":
        os.replace = before(os.replace)
    elif place == "after the rename":
        os.replace = after(os.replace)
    else:
        Path.unlink = before(Path.unlink)


PROMISE = Promise(
    "a training that is killed leaves a readable run, and loses one checkpoint interval at most", 300, 3, trials
)
