"""The command line: plants the errors, prints those that no test noticed, and the score."""

from __future__ import annotations

import argparse
import json
import os
import queue
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from tools.planted_errors.judge import CAUGHT, Judge, Outcome, copy_checkout
from tools.planted_errors.listing import LISTS, Error, read_lists

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "build" / "planted_errors.json"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.planted_errors", description=__doc__)
    parser.add_argument("--only", default="", help="errors with this text in file, right or wrong text")
    parser.add_argument("--jobs", type=int, default=1, help="errors tried side by side, each in a copy of the checkout")
    parser.add_argument("--timeout", type=float, default=600, help="seconds for one run of tests")
    parser.add_argument("--results", type=Path, default=RESULTS, help="what is caught there is not tried again")
    parser.add_argument("--table", type=Path, help="write the score per package there, as Markdown")
    options = parser.parse_args(arguments)
    errors = [error for error in read_lists(LISTS) if options.only in str(error)]
    known = json.loads(options.results.read_text("utf-8")) if options.results.is_file() else {}
    found = {error: Outcome(**known[str(error)]) for error in errors if str(error) in known}
    left = [error for error in errors if error not in found or found[error].verdict != CAUGHT]
    options.results.parent.mkdir(parents=True, exist_ok=True)
    for error, outcome in try_out(left, ROOT, options.jobs, options.timeout):
        found[error] = outcome
        known[str(error)] = vars(outcome)
        options.results.write_text(json.dumps(known, indent=1, ensure_ascii=False) + "\n", "utf-8")
        print(f"{len(found):4} of {len(errors)}  {outcome.verdict:9} {error}  {outcome.by}", flush=True)
    if options.table:
        options.table.write_text(table(found), "utf-8")
    missed = {error: outcome for error, outcome in found.items() if outcome.verdict != CAUGHT}
    print(*(f"{outcome.verdict.upper()} {error} {outcome.by}" for error, outcome in missed.items()), sep="\n")
    caught = len(found) - len(missed)
    print(f"{caught} of {len(found)} caught ({caught / max(len(found), 1):.1%})")
    return int(bool(missed) or not found)


def try_out(errors: list[Error], root: Path, jobs: int, timeout_s: float) -> Iterator[tuple[Error, Outcome]]:
    """Judges the errors in copies of a checkout, and yields each as soon as it is known."""
    with tempfile.TemporaryDirectory(prefix="planted_") as scratch:
        judges: queue.SimpleQueue[Judge] = queue.SimpleQueue()
        for number in range(min(jobs, len(errors))):
            tree = Path(scratch) / f"tree_{number}"
            copy_checkout(root, tree)
            judges.put(Judge(tree, timeout_s))

        def judge(error: Error) -> Outcome:
            free = judges.get()
            try:
                return free.judge(error)
            finally:
                judges.put(free)

        with ThreadPoolExecutor(max(jobs, 1)) as pool:
            futures = {pool.submit(judge, error): error for error in errors}
            try:
                for future in as_completed(futures):
                    yield futures[future], future.result()
            finally:
                pool.shutdown(cancel_futures=True)


def table(found: dict[Error, Outcome]) -> str:
    """Errors and how many were caught, by package."""
    packages: dict[str, list[bool]] = {}
    for error, outcome in found.items():
        packages.setdefault(os.path.dirname(error.file), []).append(outcome.verdict == CAUGHT)
    rows = [f"| {name} | {len(caught)} | {sum(caught)} |" for name, caught in sorted(packages.items())]
    return "\n".join(["| package | planted | caught |", "|---|---|---|", *rows]) + "\n"


if __name__ == "__main__":
    sys.exit(main())
