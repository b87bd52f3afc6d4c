"""A test run ends with what it did not test, and why."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from not_tested import EXTRAS, lines

TESTS = """
import pytest

@pytest.mark.parametrize("number", range(3))
def test_skipped(number):
    pytest.skip("needs a moon")

@pytest.mark.skipif(True, reason="needs a moon")
def test_skipped_by_a_mark(): ...

def test_of_an_extra():
    pytest.importorskip("rosbags.of_nobody")

def test_tested(): ...
"""
FILE = "import pytest\npytest.importorskip('no_such_module')\ndef test_one(): ...\n"


@pytest.mark.parametrize("workers", [[], ["-n", "1"]], ids=["alone", "xdist"])
def test_every_reason_is_told_at_the_end(tmp_path, root, workers):
    (tmp_path / "conftest.py").write_text("from not_tested import pytest_terminal_summary\n")
    (tmp_path / "test_some.py").write_text(TESTS)
    (tmp_path / "test_whole.py").write_text(FILE)
    command = [sys.executable, "-m", "pytest", "-q", *workers, "-o", f"pythonpath={root / 'tests'}", str(tmp_path)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    _, _, told = done.stdout.partition(" not tested ")
    assert sorted(told.splitlines()[1:4], reverse=True) == [
        "   4  needs a moon (test_some.py)",
        "   1  rosbags.of_nobody is not installed: pip install '.[rosbag]' (test_some.py)",
        "   1  no_such_module is not installed (all of test_whole.py)",
    ]


def test_nothing_is_told_where_all_was_tested():
    assert lines([]) == []


def test_extras_are_those_of_the_project(root: Path):
    project = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))["project"]
    assert set(EXTRAS.values()) <= set(project["optional-dependencies"])
