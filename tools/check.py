"""Everything that must hold before a commit: style, import rules, types, documentation, tests.

    python tools/check.py               all of it; make check does the same in its own environment
    python tools/check.py style types   these parts alone
    python tools/check.py --skip hidden-effects --skip results   all but these: measured anew before a release, in hours

Ends with a table. Exit status: 0 if all parts are in order.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROGRAMS = Path(sysconfig.get_path("scripts"))
#: Part → its commands.
PARTS = {
    "style": [["ruff", "check", "."], ["ruff", "format", "--check", "."]],
    "imports": [["lint-imports", "--no-logo"]],
    "types": [["pyright", "--pythonpath", sys.executable]],
    "docs": [["sphinx-build", "--quiet", "--fail-on-warning", "--keep-going", "--fresh-env", "docs", "build/docs"]],
    "hidden-effects": [["python", "tools/hidden_effects.py", "check"]],
    "results": [["python", "-m", "tools.results", "check"]],
    "speed": [["python", "-m", "tools.bench", "--check"]],
    "tests": [["python", "-m", "pytest", "-q", "-n", "auto", "--dist", "loadfile", "--no-loadscope-reorder"]],
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", help=f"of {', '.join(PARTS)}; all by default")
    parser.add_argument("--skip", action="append", default=[], metavar="PART", help="leave this part out")
    options = parser.parse_args()
    if unknown := {*options.parts, *options.skip} - set(PARTS):
        parser.error(f"no part {', '.join(sorted(unknown))}: there are {', '.join(PARTS)}")
    asked = [part for part in options.parts or PARTS if part not in options.skip]
    rows = [examine(*command) for part in asked for command in PARTS[part]]
    print("\n" + "\n".join(f"{name:<22}{seconds:7.1f} s  {verdict}" for name, seconds, verdict in rows))
    return int(any(verdict.startswith("failed") for _, _, verdict in rows))


def examine(program: str, *arguments: str) -> tuple[str, float, str]:
    """Runs one command and shows what it says; returns its name, how long it took, and a verdict."""
    shown = (
        word.removesuffix(".py").rpartition("/")[2]
        for word in arguments
        if word in ("check", "format", "pytest") or word.startswith("tools")
    )
    name = " ".join([program, *shown])
    found = Path(sys.executable) if program == "python" else PROGRAMS / program
    print(f"\n== {name}", flush=True)
    if not found.exists():
        return name, 0.0, "failed, not installed: make setup" + (", make docs" if "sphinx" in program else "")
    started = time.monotonic()
    status = subprocess.run([found, *arguments], cwd=ROOT, check=False).returncode
    return name, time.monotonic() - started, "failed" if status else "ok"


if __name__ == "__main__":
    sys.exit(main())
