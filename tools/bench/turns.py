"""Runs cases, each in a process of its own, in turns: whatever else the machine does hits all alike."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from tools.bench.case import Case, Learning, Measured

ROOT = Path(__file__).resolve().parents[2]
#: Seconds that a case has to end by itself, and then to end when asked to.
PATIENCE_S = 10


class Worker:
    """A case in its process, the leader of a group of all processes it starts."""

    def __init__(self, case: Case, learn: bool = False) -> None:
        self.case = case
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115 - end() closes it
        self._process = subprocess.Popen(
            [
                *(sys.executable, "-W", "ignore", "-m", "tools.bench.worker"),
                json.dumps(dataclasses.asdict(case) | {"learn": learn}),
            ],
            cwd=ROOT,
            # networks this small are quickest in one thread, here and in processes that a case starts
            env={**os.environ, "OMP_NUM_THREADS": "1"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            start_new_session=True,
        )

    def answer(self) -> dict[str, Any] | None:
        """Its next answer; None if it has ended.

        Raises:
          RuntimeError: if it failed, with the last it said.
        """
        assert self._process.stdout is not None
        if line := self._process.stdout.readline():
            return json.loads(line)
        if self._process.wait():
            self._errors.seek(0)
            said = self._errors.read().strip().splitlines() or ["no word"]
            raise RuntimeError(f"{self.case.name} ({self.case.tier}, {self.case.grasps} grasps) failed: {said[-1]}")
        return None

    def steps_per_second(self, seconds: float) -> float:
        """Runs it for at least so long."""
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):  # its answer says why
            self._process.stdin.write(f"{seconds}\n")
            self._process.stdin.flush()
        answer = self.answer()
        assert answer is not None
        return answer["steps_per_second"]

    def memory_mb(self) -> float | None:
        """Peak memory of the group, in MB, with what its processes share counted once; None where there is no /proc."""
        try:
            parts = [_memory_kb(process) for process in self._members()]
        except (OSError, KeyError):
            return None
        return (sum(own for own, _ in parts) + max(files for _, files in parts)) / 1024 if parts else None

    def end(self, patience_s: float) -> None:
        """Ends the whole group: by itself, then asked to, then without being asked."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with suppress(BrokenPipeError):
            self._process.stdin.close()
        for number in (None, signal.SIGTERM, signal.SIGKILL):
            if number is not None and self._alive():
                with suppress(ProcessLookupError):
                    os.killpg(self._process.pid, number)
            until = time.monotonic() + patience_s
            while self._alive() and time.monotonic() < until:
                time.sleep(0.02)
            patience_s = PATIENCE_S
        self._process.stdout.close()
        self._errors.close()

    def _alive(self) -> bool:
        return self._process.poll() is None or bool(self._members())

    def _members(self) -> list[int]:
        """Processes of the group that have not ended; none where there is no /proc."""
        return [int(entry.name) for entry in Path("/proc").glob("[0-9]*") if _group(entry) == self._process.pid]


@contextmanager
def worker(case: Case, learn: bool = False) -> Iterator[Worker]:
    """A case's process, ended in any event; at once if something went wrong, as with Ctrl-C."""
    at_work = Worker(case, learn)
    patience_s = 0.0
    try:
        yield at_work
        patience_s = 0.0 if learn else PATIENCE_S
    finally:
        at_work.end(patience_s)


def measure(cases: Sequence[Case], repeats: int, seconds: float, say: Callable[[str], None]) -> list[Measured]:
    """Each case's best of ``repeats`` turns of at least so many seconds, and its peak memory.

    Raises:
      RuntimeError: if a case failed.
    """
    with ExitStack() as stack:
        workers = []
        for case in cases:
            say(f"preparing {case.name}, {case.tier}, {case.grasps} grasps")
            workers.append(stack.enter_context(worker(case)))
            workers[-1].answer()
        best = dict.fromkeys(workers, 0.0)
        for repeat in range(repeats):
            for at_work in workers:
                say(f"turn {repeat + 1} of {repeats}: {at_work.case.name}, {at_work.case.tier}")
                best[at_work] = max(best[at_work], at_work.steps_per_second(seconds))
        return [Measured(at_work.case, rate, at_work.memory_mb()) for at_work, rate in best.items()]


def learn(case: Case, goal: float, limit_s: float, say: Callable[[str], None]) -> Learning:
    """Trains until the force reward is at the goal, or the time is up.

    Raises:
      RuntimeError: if the training failed.
    """
    learning = Learning(case.name, case.tier, [], goal, limit_s)
    with worker(case, learn=True) as at_work:
        while answer := at_work.answer():
            seconds, frames, reward = answer["point"]
            if seconds > limit_s:
                break
            learning.curve.append((seconds, frames, reward))
            say(f"{case.name} trains: {seconds:.0f} of {limit_s:.0f} s, {frames:,} frames, force reward {reward:.1f}")
            if learning.reached:
                break
    return learning


def _group(process: Path) -> int | None:
    """Process group of an entry of /proc; None if it has ended."""
    try:
        state, _, group = (process / "stat").read_text().rpartition(")")[2].split()[:3]
    except (OSError, ValueError):  # ended meanwhile
        return None
    return None if state == "Z" else int(group)


def _memory_kb(process: int) -> tuple[float, float]:
    """A process's peak memory less files such as libraries, with its share of what forks have in common; and the files.

    Of files there is no such share: other cases, which run beside this one, map the same.
    """
    lines = [Path(f"/proc/{process}/{name}").read_text().splitlines() for name in ("status", "smaps_rollup")]
    kb = {line.partition(":")[0]: float(line.split()[1]) for part in lines for line in part if line.endswith(" kB")}
    return kb["VmHWM"] - kb["VmRSS"] + kb["Pss_Anon"] + kb["Pss_Shmem"], kb["RssFile"]
