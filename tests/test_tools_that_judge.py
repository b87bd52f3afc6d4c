"""The programs that say whether all is in order say so when it is not."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest

PYTHON = Path(sys.executable)


@pytest.fixture
def check(root, monkeypatch):
    """``check(command, ...)``: exit status of tools/check.py with these commands in place of its own."""
    tool = runpy.run_path(str(root / "tools" / "check.py"))

    def status(*commands: list[str]) -> int:
        tool["PARTS"].clear()
        tool["PARTS"]["part"] = list(commands)
        monkeypatch.setattr(sys, "argv", ["check.py"])
        return tool["main"]()

    return status


def test_check_of_what_is_in_order(check, capfd):
    assert check(["python", "-c", "print('well')"]) == 0
    assert capfd.readouterr().out.rstrip().endswith("ok")


def test_check_of_what_is_not(check, capfd):
    assert check(["python", "-c", "raise SystemExit(3)"], ["python", "-c", "pass"]) == 1
    first, second = capfd.readouterr().out.splitlines()[-2:]
    assert (first.split()[-1], second.split()[-1]) == ("failed", "ok")


def test_check_without_its_programs(check, capfd):
    assert check(["no-such-program"]) == 1
    assert "failed, not installed: make setup" in capfd.readouterr().out


def test_check_of_a_part_that_is_not_there(root, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["check.py", "taste"])
    with pytest.raises(SystemExit, match="2"):
        runpy.run_path(str(root / "tools" / "check.py"), run_name="__main__")
    assert "no part taste" in capsys.readouterr().err


def test_check_leaves_out_what_it_is_told_to(root, monkeypatch, capfd):
    tool = runpy.run_path(str(root / "tools" / "check.py"))
    tool["PARTS"].clear()
    tool["PARTS"] |= {"well": [["python", "-c", "pass"]], "ill": [["python", "-c", "raise SystemExit(3)"]]}
    for arguments, status in (((), 1), (("--skip", "ill"), 0), (("well",), 0), (("ill", "--skip", "well"), 1)):
        monkeypatch.setattr(sys, "argv", ["check.py", *arguments])
        assert tool["main"]() == status, arguments
    monkeypatch.setattr(sys, "argv", ["check.py", "--skip", "taste"])
    with pytest.raises(SystemExit, match="2"):
        tool["main"]()
    assert "no part taste" in capfd.readouterr().err


def test_the_parts_of_a_check_have_names_that_tell_them_apart(root, capfd):
    tool = runpy.run_path(str(root / "tools" / "check.py"))
    assert "hidden-effects" in tool["PARTS"]
    assert tool["examine"]("python", "tools/no_such_tool.py", "check")[0] == "python no_such_tool check"


@pytest.fixture
def smoke(root, tmp_path, monkeypatch):
    """The program that tries the wheel, and a folder that it may think is its own."""
    (tmp_path / "work").mkdir()
    return runpy.run_path(str(root / "tools" / "wheel_smoke.py"))


@pytest.mark.parametrize(
    ("program", "options", "failure"),
    [
        ("print('well')", {}, ""),
        ("open('there', 'w')", {"leaves": ("there",)}, ""),
        ("pass", {"leaves": ("there",)}, "did not leave there"),
        ("raise SystemExit(3)", {}, "exit status 3"),
        ("raise ValueError('broken')", {}, "ValueError: broken"),
        ("raise SystemExit('no OpenGL here')", {"or_says": "no OpenGL"}, ""),
        ("import os; assert 'DISPLAY' not in os.environ and 'PYTHONPATH' not in os.environ", {}, ""),
        ("import urllib.request as u; u.urlopen('http://example.org', timeout=5)", {}, "URLError"),
    ],
)
def test_steps_of_the_smoke_test(program, options, failure, smoke, tmp_path, monkeypatch):
    monkeypatch.setenv("DISPLAY", ":0")
    found = smoke["run"](smoke["Step"]("step", [PYTHON.name, "-c", program], **options), tmp_path, PYTHON.parent)
    assert failure in found
    assert bool(found) == bool(failure)


def test_smoke_test_needs_a_run_to_interrupt(smoke, tmp_path):
    checkpoints = tmp_path / "run" / "checkpoints"
    checkpoints.mkdir(parents=True)
    for name in ("8", "16", "24"):
        (checkpoints / f"frames_{int(name):012d}.safetensors").touch()
    (checkpoints / "best.safetensors").touch()
    smoke["interrupt"](tmp_path)
    assert {path.name for path in checkpoints.iterdir()} == {"best.safetensors", "frames_000000000008.safetensors"}
    with pytest.raises(RuntimeError, match="only checkpoint"):
        smoke["interrupt"](tmp_path)
