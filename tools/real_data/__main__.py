"""Public recordings of real drives: imports, diagnoses, judges on data held out, draws, writes the page.

    python -m tools.real_data --data FOLDER --out FOLDER               all sets; what is done is not done again
    python -m tools.real_data --data FOLDER --out FOLDER --sets emps   one of them
    python -m tools.real_data --out FOLDER --page PAGE                 only pictures and the page, of what there is

FOLDER of the data has a folder per set; docs/real-data.md says where each comes from, and its checksums.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import time
from pathlib import Path

SETS = ("emps", "so101_jaw", "xl330", "dfki_pendulum")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, help="folder of the recordings")
    parser.add_argument("--out", type=Path, required=True, help="folder of the results")
    parser.add_argument("--sets", default=",".join(SETS), help="which ones, separated by commas")
    parser.add_argument("--splits", type=int, default=20, help="splits of the jaw's motions; each takes minutes")
    parser.add_argument("--page", type=Path, help="page whose marked parts are written anew, with pictures beside it")
    options = parser.parse_args()
    chosen = [name for name in options.sets.split(",") if name]
    if unknown := sorted(set(chosen) - set(SETS)):
        parser.error(f"--sets: {', '.join(unknown)} is unknown; there are {', '.join(SETS)}")
    if options.data:
        studies = {name: importlib.import_module(f"tools.real_data.{name}") for name in chosen}
        minutes = sum(study.MINUTES for study in studies.values())
        print(f"{len(chosen)} sets, about {minutes / 60:.1f} hours on two cores; what is done is not done again")
        for name, module in studies.items():
            start = time.monotonic()
            folder = options.out / name
            more = {"splits": options.splits} if hasattr(module, "SPLITS") else {}
            result = module.study(options.data, folder, **more)
            result.write(folder)
            words = ", ".join(result.found) or "nothing found"
            print(f"{name}: {result.verdict}, {words} ({time.monotonic() - start:.0f} s)")
    if options.page:
        from tools.real_data.page import write_page

        write_page(options.page, options.out, chosen)
    return 0


if __name__ == "__main__":
    sys.exit(main())
