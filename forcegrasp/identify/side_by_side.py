"""Fits that run side by side: what they ask the same simulator for is simulated at once.

An effect that acts in each physics step costs as much for the grasps of one model as for those of five.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

from forcegrasp.identify.predict import TAKEN_BY, Case, predict_each
from forcegrasp.replay.replay import Replay

T = TypeVar("T")


def side_by_side(tasks: Sequence[Callable[[], T]]) -> list[T]:
    """What the tasks return, in their order, each as if it ran alone.

    Tasks may run others side by side themselves.

    Args:
      tasks: that share nothing but simulators.

    Raises:
      Exception: the first of those that tasks raised, once all have ended.
    """
    if len(tasks) < 2:
        return [task() for task in tasks]
    gathering = _Gathering([_Run(task) for task in tasks])
    return gathering.results()


@dataclass(eq=False)
class _Run(Generic[T]):
    """A task in a thread of its own, and what it waits for."""

    task: Callable[[], T]
    result: list[T] = field(default_factory=list)  #: one, once there is one
    error: BaseException | None = None
    asks: tuple[Replay, Sequence[Sequence[Case]]] | None = None
    answer: Sequence[np.ndarray] = ()


class _Gathering(Generic[T]):
    """Tasks, all of which run until they ask for something; then what most of them wait for is simulated."""

    def __init__(self, runs: Sequence[_Run[T]]) -> None:
        self._runs, self._at_work = runs, len(runs)
        self._changed = threading.Condition()
        self._stopped: BaseException | None = None

    def results(self) -> list[T]:
        """Runs the tasks to their ends."""
        threads = [threading.Thread(target=self._run, args=(run,), daemon=True) for run in self._runs]
        for thread in threads:
            thread.start()
        try:
            while waiting := self._all_that_wait():
                self._serve(waiting)
        except BaseException as stopped:  # such as Ctrl-C: no thread is left behind
            with self._changed:
                self._stopped = stopped
                self._changed.notify_all()
            raise
        finally:
            for thread in threads:
                thread.join()
        for error in (run.error for run in self._runs if run.error is not None):
            raise error
        return [run.result[0] for run in self._runs]

    def _run(self, run: _Run[T]) -> None:
        """A task's thread."""
        TAKEN_BY.set(lambda replay, asked: self._ask(run, replay, asked))
        try:
            run.result.append(run.task())
        except BaseException as error:
            run.error = error
        with self._changed:
            self._at_work -= 1
            self._changed.notify_all()

    def _ask(self, run: _Run[T], replay: Replay, asked: Sequence[Sequence[Case]]) -> Sequence[np.ndarray]:
        """Waits, in a task's thread, for what it asks for."""
        with self._changed:
            run.asks = replay, asked
            self._at_work -= 1
            self._changed.notify_all()
            self._changed.wait_for(lambda: run.asks is None or self._stopped is not None)
        if self._stopped is not None:
            raise self._stopped
        return run.answer

    def _all_that_wait(self) -> list[_Run[T]]:
        """The tasks that wait, once none is at work; none once all have ended."""
        with self._changed:
            self._changed.wait_for(lambda: self._at_work == 0)
        return [run for run in self._runs if run.asks is not None]

    def _serve(self, waiting: Sequence[_Run[T]]) -> None:
        """Simulates what most of the waiting tasks ask for; the others may be joined by more."""
        asked = [(run, *run.asks) for run in waiting if run.asks is not None]
        replays = [replay for _, replay, _ in asked]
        most = max(replays, key=replays.count)
        served = [(run, cases) for run, replay, cases in asked if replay is most]
        answers = iter(predict_each(most, [one for _, cases in served for one in cases]))
        for run, cases in served:
            run.answer = [next(answers) for _ in cases]
        with self._changed:
            self._at_work += len(served)
            for run, _ in served:
                run.asks = None
            self._changed.notify_all()
