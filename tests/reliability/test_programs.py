"""The reliability programs: a few trials of each find nothing, and a promise that is broken is told."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture
def tool(root, monkeypatch):
    """The command line of the programs."""
    monkeypatch.syspath_prepend(root)
    from tools.reliability import __main__

    return __main__


@pytest.mark.long
def test_a_few_trials_of_everything(root, tool):
    """In a process of its own, as the programs fork and other tests have started threads."""
    command = [sys.executable, "-m", "tools.reliability", "--few"]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    quick = [name for name in tool.NAMES if tool.promise(name).few]
    assert re.findall(r"^(\d+) of \d+ failed", done.stdout, re.MULTILINE) == ["0"] * len(quick)


def test_broken_promises_are_counted_and_told(tool, monkeypatch, capsys, tmp_path):
    def trials(count: int, seed: int) -> Iterator:
        for number in range(count):
            yield tool.Trial(f"trial {number}", "it broke" if number == seed else "", "tried")

    monkeypatch.setattr(tool, "promise", lambda name: tool.Promise("it holds", 5, 2, trials))
    out = tmp_path / "result.json"
    assert tool.main(["kills", "--seed", "3", "--json", str(out)]) == 1
    printed = capsys.readouterr().out
    assert "FAILED trial 3: it broke" in printed
    assert "1 of 5 failed" in printed
    assert json.loads(out.read_text())["failures"] == [{"trial": "trial 3", "failure": "it broke"}]
    assert tool.main(["kills", "--seed", "9"]) == 0
    assert tool.main(["kills", "--trials", "0"]) == 1, "no trial is no promise kept"


def test_a_child_that_dies_hangs_or_raises_takes_nothing_along(root, tmp_path):
    code = """
import os, time
from tools.reliability.child import each
def attempt(case):
    if case == "dies": os.abort()
    if case == "hangs": time.sleep(60)
    if case == "raises": raise KeyError("x")
    return case
cases = ["one", "dies", "two", "hangs", "three", "raises", "four"]
for case, answer, problem in each(cases, attempt, 0.2):
    print(case, answer, problem.split(" at ")[0], sep="|")
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [
        "one|one|",
        "dies|None|the process died",
        "two|two|",
        "hangs|None|no answer within 1 s",
        "three|three|",
        "raises|None|KeyError",
        "four|four|",
    ]


def test_the_page_names_every_program(root, tool):
    page = (Path(root) / "docs" / "reliability.md").read_text()
    assert {f"python -m tools.reliability {name}" for name in tool.NAMES} <= set(
        re.findall(r"python -m tools\.reliability \w+", page)
    )
