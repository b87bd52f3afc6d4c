"""Where the time goes, and what other stacks make of the same grasp: ratios of one run.

    python -m tools.bench                                    the layers at both tiers of the physics, and the peers
    python -m tools.bench --scale --json speed.json --figure  also how the layers grow with grasps and with threads
    python -m tools.bench --time-to-reward 3600              also how long training takes until a force reward of 100
    python -m tools.bench --only simulator training          some layers, peers or trainings alone
    python -m tools.bench --from speed.json --figure         tables and pictures of what was measured before
    python -m tools.bench --history                          also adds the ratios to a file in docs, and draws it
    python -m tools.bench --check                            fails where the last ratios there fell by more than 10 %

Each layer and peer runs in a process of its own. They take turns, and the best of their repeats counts, so that
whatever else the machine does hits all alike. Peers need `pip install '.[bench]'`; what is not installed is left out.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console

from forcegrasp.cores import usable_cores
from tools.bench.case import Case, Measured
from tools.bench.figures import draw
from tools.bench.history import draw_history, entry, lost
from tools.bench.learning import LEARNED, TRAININGS
from tools.bench.levels import LEVELS
from tools.bench.peers import PEERS, missing
from tools.bench.results import Results, machine
from tools.bench.tables import tables
from tools.bench.turns import ROOT, learn, measure
from tools.json_lines import append, read

GOAL = 100.0
TIERS = ("fast", "reference")
#: What the authors simulate.
PEER_TIER = "reference"
FIGURE = ROOT / "docs" / "figures" / "speed.png"
HISTORY = ROOT / "docs" / "speed-history.jsonl"


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tools.bench", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    names = [*LEVELS, *PEERS, *TRAININGS]
    parser.add_argument("--only", nargs="+", choices=names, default=names, metavar="NAME", help="; ".join(names))
    parser.add_argument("--grasps", type=_count, default=256, help="at once, in the layers (256)")
    parser.add_argument("--tiers", nargs="+", choices=TIERS, default=TIERS, help="of the layers' physics (both)")
    parser.add_argument("--threads", type=int, default=0, help="of the layers' physics (every core)")
    parser.add_argument("--processes", type=_count, default=10, help="of each peer (10)")
    parser.add_argument("--repeats", type=_count, default=3, help="turns, of which the best counts (3)")
    parser.add_argument("--seconds", type=float, default=1.0, help="that a turn lasts at least (1)")
    parser.add_argument(
        "--scale", nargs="*", type=_count, metavar="N", help="growth with grasps, 16 64 256 1024 4096, and with threads"
    )
    parser.add_argument("--time-to-reward", type=float, metavar="SECONDS", help="train each stack for so long at most")
    parser.add_argument("--json", type=Path, help="file to write, as soon as a part is measured")
    parser.add_argument("--figure", nargs="?", type=Path, const=FIGURE, help=f"to draw ({FIGURE.relative_to(ROOT)})")
    parser.add_argument("--from", type=Path, dest="source", help="JSON of an earlier run: measure nothing")
    parser.add_argument(
        "--history",
        nargs="?",
        type=Path,
        const=HISTORY,
        help=f"file to add the ratios to ({HISTORY.relative_to(ROOT)})",
    )
    parser.add_argument("--check", nargs="?", type=Path, const=HISTORY, help="a history, and measure nothing")
    options = parser.parse_args(arguments)
    if options.source and not options.source.is_file():
        parser.error(f"--from {options.source}: no such file")
    return options


def _count(text: str) -> int:
    if (count := int(text)) < 1:
        raise argparse.ArgumentTypeError("must be 1 or more")
    return count


class Benchmark:
    """Measures part after part; results are written after each."""

    def __init__(self, options: argparse.Namespace, console: Console) -> None:
        self.options, self.console = options, console
        self.results = Results(options.processes, machine=machine())
        asked = [name for name in options.only if options.time_to_reward is not None or name not in TRAININGS]
        self.names = [name for name in asked if not self._left_out(name)]

    def run(self) -> None:
        options, results = self.options, self.results
        levels = [name for name in self.names if name in LEVELS]
        ours = [Case(name, tier, options.grasps, options.threads) for tier in options.tiers for name in levels]
        peers = [Case(name, PEER_TIER, options.processes, 1) for name in self.names if name in PEERS]
        measured = self._measure([*ours, *peers])
        results.levels, results.peers = measured[: len(ours)], measured[len(ours) :]
        self._save()
        if options.scale is not None and levels:
            tier = options.tiers[0]
            for grasps in options.scale or (16, 64, 256, 1024, 4096):
                results.by_grasps += self._measure([Case(name, tier, grasps, options.threads) for name in levels])
                self._save()
            for threads in sorted({*(2**k for k in range(usable_cores().bit_length())), usable_cores()}):
                results.by_threads += self._measure([Case(name, tier, options.grasps, threads) for name in levels])
                self._save()
        if options.time_to_reward is not None:
            for name, tier in LEARNED:
                if name in self.names:
                    with self._progress() as say:
                        case = Case(name, tier, options.processes)
                        results.learning.append(learn(case, GOAL, options.time_to_reward, say))
                    self._save()

    def _measure(self, cases: list[Case]) -> list[Measured]:
        with self._progress() as say:
            return measure(cases, self.options.repeats, self.options.seconds, say)

    @contextmanager
    def _progress(self) -> Iterator[Callable[[str], None]]:
        """A function that reports progress: in a line that changes, or line by line where that can't be."""
        if self.console.is_terminal:
            with self.console.status("") as status:
                yield status.update
        else:
            yield lambda text: print(text, file=sys.stderr, flush=True)

    def _save(self) -> None:
        if self.options.json:
            self.results.write(self.options.json)

    def _left_out(self, name: str) -> bool:
        if module := missing(name):
            self.console.print(f"left out: {name}, which needs {module}: pip install '.\\[bench]'")
        return bool(module)


def main(arguments: list[str] | None = None) -> int:
    options, console = parse(arguments), Console()
    if options.check:
        return _check(options.check, console)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that it ends its processes
    if options.source:
        results = Results.read(options.source)
    else:
        benchmark = Benchmark(options, console)
        results = benchmark.results
        try:
            benchmark.run()
        except KeyboardInterrupt:
            console.print("interrupted")
            return 130
        except RuntimeError as error:
            console.print(str(error), style="red", markup=False)
            return 1
    for table in tables(results):
        console.print(table)
    if options.figure:
        for path in draw(results, options.figure):
            console.print(f"drew {path}")
    if options.history and (one := entry(results)) is not None:
        append(options.history, one)
        draw_history(read(options.history), options.history.with_suffix(".png"))
        console.print(f"wrote {options.history} and {options.history.with_suffix('.png').name}")
    return 0


def _check(path: Path, console: Console) -> int:
    """Exit status: 1 if a ratio fell since the last commit that was measured on the same machine."""
    fell = lost(read(path))
    for line in fell:
        console.print(f"{path.name}: {line}", markup=False)
    return int(bool(fell))


if __name__ == "__main__":
    sys.exit(main())
