"""Tries things in a forked process: what hangs, crashes or eats memory there takes nothing along."""

from __future__ import annotations

import gc
import json
import os
import resource
import select
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

#: A process that asks for more than this on top of what it has gets a MemoryError.
MEMORY = 6 << 30


def fork(work: Callable[[], int | None], said: Path | None = None) -> int:
    """Runs ``work`` in a forked process and returns its id. Its exit status is what ``work`` returns.

    What it writes to stderr, and the traceback of an exception, go to the file ``said``.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    gc.freeze()  # lest the child's garbage collector goes through all that was imported, and copies it
    process = os.fork()
    if process:
        return process
    status = 99
    try:
        os.dup2(os.open(os.devnull, os.O_RDWR), 0)
        os.dup2(0, 1)
        os.dup2(0 if said is None else os.open(said, os.O_CREAT | os.O_WRONLY | os.O_TRUNC), 2)
        status = work() or 0
    except BaseException:
        os.write(2, traceback.format_exc().encode())
    finally:
        os._exit(status)


def each(cases: Sequence[Any], try_one: Callable[[Any], Any], seconds: float) -> Iterator[tuple[Any, Any, str]]:
    """Tries the cases in forked processes, one process as long as it lives.

    A case may take ``seconds`` of the processor, and five times that by the clock, as other programs may be at work.

    Yields:
      case, what ``try_one`` returned (None if it did not; JSON can hold it), and how it went wrong, or "".
    """
    done = 0
    while done < len(cases):
        reader, writer = os.pipe()
        rest = cases[done:]

        def work(rest: Sequence[Any] = rest, writer: int = writer) -> None:
            _limit_memory()
            for case in rest:
                started = time.process_time()
                try:
                    value, took = try_one(case), time.process_time() - started
                    answer = (value, f"took {took:.1f} s" if took > seconds else "")
                except BaseException as error:
                    where = traceback.extract_tb(error.__traceback__)[-1]
                    place = f"{os.path.basename(where.filename)}:{where.lineno}"
                    answer = (None, f"{type(error).__name__} at {place}: {str(error)[:200]}")
                message = json.dumps(answer).encode()
                os.write(writer, len(message).to_bytes(8, "little") + message)

        process = fork(work)
        os.close(writer)
        try:
            for case in rest:
                answer = _receive(reader, 5 * seconds)
                if isinstance(answer, str):
                    yield case, None, answer
                    done += 1
                    break
                yield case, *answer
                done += 1
        finally:
            os.close(reader)
            os.kill(process, signal.SIGKILL)
            os.waitpid(process, 0)


def _limit_memory() -> None:
    if sys.platform == "linux":
        has = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (has + MEMORY, has + MEMORY))


def _receive(reader: int, seconds: float) -> tuple[Any, str] | str:
    """One answer of the child; text if there is none."""
    data = b""
    until = time.monotonic() + seconds
    while len(data) < 8 or len(data) < 8 + int.from_bytes(data[:8], "little"):
        left = until - time.monotonic()
        if left <= 0 or not select.select([reader], [], [], left)[0]:
            return f"no answer within {seconds:g} s"
        want = 8 - len(data) if len(data) < 8 else 8 + int.from_bytes(data[:8], "little") - len(data)
        piece = os.read(reader, want)
        if not piece:
            return "the process died"
        data += piece
    return json.loads(data[8:])


def peak_memory_mb() -> float:
    """The most memory that this process has had so far, MB."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1e6 if sys.platform == "darwin" else 1e3)
