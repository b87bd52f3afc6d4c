"""Signals that ask a training to save and end: Ctrl-C, a scheduler's, and that of a terminal that is gone."""

from __future__ import annotations

import multiprocessing
import os
import select
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def stop_signals(also: Callable[[], None] = lambda: None) -> Iterator[list[int]]:
    """Yields a list that is not empty once the user, a lost terminal or a scheduler asked to stop.

    Args:
      also: done at each signal.
    """
    asked: list[int] = []

    def ask(number: int, _frame: Any) -> None:
        if asked and number == signal.SIGINT:  # shell and system both send a hang-up
            raise KeyboardInterrupt
        asked.append(number)
        if number == signal.SIGHUP:
            _silence_lost_outputs()
        also()

    # nohup ignores hang-ups, and a scheduler's own job runner may use SIGUSR1: then they are not for us
    free = [n for n in (signal.SIGHUP, signal.SIGUSR1) if _is_free(signal.getsignal(n))]
    try:
        before = {number: signal.signal(number, ask) for number in (signal.SIGINT, signal.SIGTERM, *free)}
    except ValueError:  # not the main thread, as in some sweep launchers: they have their own way to stop a job
        before = {}
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _is_free(handler: Any) -> bool:
    """Whether nobody waits for the signal but this module, for a sweep around a training."""
    return handler == signal.SIG_DFL or getattr(handler, "__module__", "") == __name__


def tell_workers() -> None:
    """Asks the processes that this one started to save and end; a terminal's signal may reach them as well."""
    for worker in multiprocessing.active_children():
        worker.terminate()


def _silence_lost_outputs() -> None:
    """What is printed to a terminal or reader that is gone goes nowhere from now on, instead of failing."""
    outputs = select.poll()
    for descriptor in (1, 2):
        outputs.register(descriptor, 0)  # errors and hang-ups are always reported
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for descriptor, _ in outputs.poll(0):
        os.dup2(nowhere, descriptor)
    os.close(nowhere)
