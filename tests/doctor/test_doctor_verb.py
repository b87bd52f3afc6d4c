"""``forcegrasp doctor`` as a whole: lines, exit status, and that it survives what it looks for."""

from __future__ import annotations

import subprocess
import sys

import pytest

from forcegrasp import doctor
from forcegrasp.cli.main import main
from forcegrasp.doctor.finding import Finding, fine, mend, note, warning


def says(capsys, monkeypatch, *findings: Finding) -> tuple[int, list[str]]:
    monkeypatch.setattr(doctor, "examine", lambda: iter(findings))
    status = main(["doctor"])
    captured = capsys.readouterr()
    assert not captured.err
    return status, captured.out.splitlines()


def test_all_is_fine(capsys, monkeypatch):
    status, lines = says(capsys, monkeypatch, fine("a", "good"), note("b", "so it is"))
    assert (status, lines[-1]) == (0, "all that is needed is fine")
    assert lines[0].split() == ["fine", "a", "good"]


def test_warnings_do_not_count(capsys, monkeypatch):
    status, lines = says(capsys, monkeypatch, warning("a", "slow", "hurry"), fine("b", "good"))
    assert (status, lines[-1]) == (0, "all that is needed is fine (1 warning)")
    assert lines[0].endswith("slow; hurry")


def test_something_to_mend(capsys, monkeypatch):
    bad = [mend("a", "two\nlines", "glue"), mend("b", "broken", "glue"), warning("c", "slow", "hurry")]
    status, lines = says(capsys, monkeypatch, *bad)
    assert (status, lines[-1]) == (1, "2 things to mend (1 warning)")
    assert len(lines) == 4


@pytest.mark.parametrize("level", ["warning", "mend"])
def test_bad_news_comes_with_a_remedy(level):
    with pytest.raises(ValueError, match="not a finding"):
        Finding(level, "a", "broken")


def test_a_check_that_fails_is_a_finding():
    def check_of_mine():
        yield fine("mine", "so far")
        raise OSError("no such thing")

    found = list(doctor.examine([check_of_mine, lambda: [fine("next", "good")]]))
    assert [finding.level for finding in found] == ["fine", "warning", "fine"]
    assert "could not be checked (OSError: no such thing)" in found[1].text


def test_a_set_needs_no_data(tmp_path, monkeypatch, capsys):
    seen = []
    monkeypatch.setattr("forcegrasp.doctor.measurements.check_data", lambda path: seen.append(path) or [fine("a", "b")])
    assert main(["doctor", str(tmp_path)]) == 0
    assert seen == [str(tmp_path)]
    assert "all that is needed is fine" in capsys.readouterr().out


@pytest.mark.parametrize("arguments", [["physics"], ["a=1"], ["--verbose"]])
def test_takes_no_other_options(arguments, capsys):
    assert main(["doctor", *arguments]) == 2
    assert capsys.readouterr().err.startswith(
        f"forcegrasp: doctor takes gripper=NAME or data=SET, not '{arguments[0]}'"
    )


def test_works_where_nothing_else_does(tmp_path):
    """Modules that are broken in the worst of ways, in this process and its children."""
    for name in ("torch", "torchrl", "tensordict", "mujoco", "numpy", "scipy", "packaging"):
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('broken beyond belief')")
    program = (
        "import sys; from forcegrasp.cli.main import main; status = main(['doctor']);"
        "heavy = {'torch', 'torchrl', 'mujoco', 'gymnasium'} & set(sys.modules); sys.exit(' '.join(heavy) or status)"
    )
    (tmp_path / "gymnasium.py").write_text("raise ImportError('broken beyond belief')")
    (tmp_path / "work").mkdir()
    environment = {"PYTHONPATH": str(tmp_path), "PATH": "/usr/bin:/bin"}
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, cwd=tmp_path / "work", env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 1, done.stderr
    assert not done.stderr
    (line,) = (line for line in done.stdout.splitlines() if "(RuntimeError: broken beyond belief); mend its" in line)
    assert all(f"{module}, " in line for module in ("numpy", "scipy.optimize", "torch", "torchrl.envs"))
    assert "a grasp can't be simulated (RuntimeError: broken beyond belief, with franka_hand)" in done.stdout
    assert "hides this environment's packages: " in done.stdout
    assert "runs can be written" in done.stdout
    assert not list((tmp_path / "work").iterdir())


def test_another_verb_sends_to_the_doctor(monkeypatch, capsys):
    from forcegrasp.cli import main as module

    def broken() -> None:
        raise ImportError("bindings are missing.\nRepair them", name="mujoco")

    monkeypatch.setattr(module, "import_mujoco", broken)
    assert main(["effects"]) == 2
    told = "forcegrasp: bindings are missing. Repair them; see what is wrong with: forcegrasp doctor\n"
    assert capsys.readouterr().err == told


def test_a_fault_of_our_own_is_not_hidden(monkeypatch):
    from forcegrasp.cli import main as module

    def broken() -> None:
        raise ImportError("cannot import name", name="forcegrasp.config")

    monkeypatch.setattr(module, "import_mujoco", broken)
    with pytest.raises(ImportError):
        main(["effects"])
