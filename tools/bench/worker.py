"""The process in which one case runs, so that its memory is its own: ``python -m tools.bench.worker CASE``.

CASE is JSON: a level or peer is prepared and run once, then run again for each line of stdin for as many seconds as
it says, and what came out is printed as a line of JSON. A training reports each of its batches. Ends with its stdin.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from typing import Any

from tools.bench.case import Case


def measure(case: Case, send: Callable[[dict[str, Any]], None]) -> None:
    """Times a case whenever stdin asks for it."""
    from tools.bench.levels import LEVELS
    from tools.bench.peers import PEERS

    run = (LEVELS | PEERS)[case.name](case)
    run()  # the first time warms up
    send({"ready": True})
    for line in sys.stdin:
        seconds, frames, started = float(line), 0, time.perf_counter()
        while not frames or time.perf_counter() - started < seconds:
            frames += run()
        send({"steps_per_second": frames / (time.perf_counter() - started)})


def learn(case: Case, send: Callable[[dict[str, Any]], None]) -> None:
    """Trains, and reports each batch: seconds since the start, frames, reward."""
    from tools.bench.learning import TRAININGS

    started = 0.0

    def report(frames: int, reward: float) -> None:
        send({"point": [time.perf_counter() - started, frames, reward]})

    started = time.perf_counter()
    TRAININGS[case.name](case.tier, case.grasps, report)


def main() -> None:
    # what libraries print must not be taken for an answer
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)

    def send(answer: dict[str, Any]) -> None:
        print(json.dumps(answer), file=answers, flush=True)

    asked = json.loads(sys.argv[1])
    task = learn if asked.pop("learn") else measure
    task(Case(**asked), send)


if __name__ == "__main__":
    main()
