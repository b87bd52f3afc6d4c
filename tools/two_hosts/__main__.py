"""Tries Ray and SLURM on two machines: namespaces of this one, each with its name, address, processes and /tmp.

    python -m tools.two_hosts                          # as root; ten minutes on two idle cores
    python -m tools.two_hosts --page docs/cluster.md   # and writes what came of it there

Needs the extras ray and cluster, and SLURM and munge (Debian: slurm-wlm, munge).
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from tools.marked_part import with_part
from tools.two_hosts import ray_cluster, slurm_cluster
from tools.two_hosts.hosts import Pair

PROGRAMS = {"ray": ray_cluster, "slurm": slurm_cluster}


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m tools.two_hosts", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", choices=PROGRAMS, help="one of the two")
    parser.add_argument("--page", type=Path, help="page whose marked part is written anew")
    parser.add_argument("--out", type=Path, help="folder that keeps runs and logs; not kept by default")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=Path.home()) as temporary:  # each machine has a /tmp of its own
        folder = options.out or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        rows = []
        for name, program in PROGRAMS.items():
            if options.only in (None, name):
                with Pair(folder) as hosts:
                    for what, result in program.tries(hosts, folder.absolute() / name):
                        print(f"{name}: {what}: {result}", flush=True)
                        rows.append(f"| {name} | {what} | {result} |")
    if options.page:
        table = "\n".join(["| by | what | result |", "|---|---|---|", *rows])
        options.page.write_text(with_part(options.page.read_text("utf-8"), "tools/two_hosts", table), "utf-8")


if __name__ == "__main__":
    main()
