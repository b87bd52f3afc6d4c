"""Says at the end of a test run what was not tested, and why: skipped tests are otherwise a letter in a row of dots."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterable

import pytest

#: Top-level module → extra of pyproject.toml that brings it.
EXTRAS = {
    "hydra_plugins": "cluster",
    "imageio_ffmpeg": "video",
    "nbformat": "docs",
    "ray": "ray",
    "rosbags": "rosbag",
}


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Writes a line per reason, after all workers have reported."""
    skipped = [(report.nodeid, report.longrepr) for report in terminalreporter.stats.get("skipped", [])]
    if told := lines((name, told[2] if isinstance(told, tuple) else str(told)) for name, told in skipped):
        terminalreporter.write_sep("=", "not tested")
        for line in told:
            terminalreporter.write_line(line)


def lines(skipped: Iterable[tuple[str, str]]) -> list[str]:
    """Skipped tests grouped by reason, most first.

    Args:
      skipped: id of each test (or of a file that was skipped as a whole), and why it was.
    """
    files: dict[str, Counter[str]] = defaultdict(Counter)
    for test, reason in skipped:
        file, _, name = test.partition("::")
        files[_in_plain_words(reason)][file if name else f"all of {file}"] += 1
    ordered = sorted(files.items(), key=lambda item: -item[1].total())
    return [f"{found.total():4}  {reason} ({', '.join(sorted(found))})" for reason, found in ordered]


def _in_plain_words(reason: str) -> str:
    reason = " ".join(reason.split()).removeprefix("Skipped: ")
    if missing := re.match(r"could not import '([\w.]+)'", reason):
        extra = EXTRAS.get(missing[1].partition(".")[0])
        return f"{missing[1]} is not installed" + (f": pip install '.[{extra}]'" if extra else "")
    return reason
