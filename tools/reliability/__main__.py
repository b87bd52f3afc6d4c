"""The command line of the reliability programs."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from datetime import date
from importlib import import_module
from pathlib import Path

from tools.reliability.trial import Promise, Trial

NAMES = (
    "kills",
    "resumes",
    "sweeps",
    "writers",
    "full_disk",
    "measurements",
    "physics",
    "divergence",
    "command_lines",
    "hostile",
    "suites",
    "soak",
)


def promise(name: str) -> Promise:
    """A promise by the name of its program."""
    return import_module(f"tools.reliability.{name}").PROMISE


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.reliability", description=__doc__)
    parser.add_argument("name", nargs="?", choices=NAMES, help="what to try; all are listed without it")
    parser.add_argument("--trials", type=int, help="how often; as in docs/reliability.md by default")
    parser.add_argument("--few", action="store_true", help="all programs that have a quick version, one after another")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, help="also write the result there")
    options = parser.parse_args(arguments)
    if options.few:
        quick = [name for name in NAMES if promise(name).few]
        return max(measure(name, promise(name).few, options.seed, None) for name in quick)
    if options.name is None:
        for name in NAMES:
            print(f"{name:14}{promise(name).text}")
        return 0
    return measure(options.name, options.trials, options.seed, options.json)


def measure(name: str, trials: int | None, seed: int, out: Path | None) -> int:
    """Runs one program, prints its failures and a summary; returns 1 if any trial failed."""
    what, started = promise(name), time.monotonic()
    print(f"{name}: {what.text}", flush=True)
    count, kinds, failures = 0, Counter(), list[Trial]()
    for trial in what.run(what.trials if trials is None else trials, seed):
        count += 1
        kinds[trial.kind] += bool(trial.kind)
        if trial.failure:
            failures.append(trial)
            print(f"  FAILED {trial.name}: {trial.failure}", flush=True)
        if sys.stderr.isatty():
            print(f"\r{count} tried, {len(failures)} failed", end="", file=sys.stderr)
    seconds = time.monotonic() - started
    for kind, times in sorted(kinds.items()):
        print(f"  {times:6} {kind}")
    print(f"{len(failures)} of {count} failed ({seconds:.0f} s)")
    if out is not None:
        found = [{"trial": trial.name, "failure": trial.failure} for trial in failures]
        result = {"name": name, "promise": what.text, "trials": count, "seed": seed, "failures": found}
        result |= {"kinds": dict(kinds), "date": date.today().isoformat(), "seconds": round(seconds)}
        out.write_text(json.dumps(result, indent=1, ensure_ascii=False) + "\n", "utf-8")
    return 1 if failures or not count else 0


if __name__ == "__main__":
    sys.exit(main())
