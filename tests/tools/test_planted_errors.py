"""The list of planted errors fits the code as it is, and the program tells what was noticed from what was not."""

from __future__ import annotations

import ast
import json
import subprocess

import pytest

from tools.planted_errors import __main__ as program
from tools.planted_errors import judge
from tools.planted_errors.listing import Error, read_lists

ERRORS = read_lists()


def test_every_error_can_be_planted(root):
    assert {str(error): found for error in ERRORS if (found := error.problem(root))} == {}
    assert len(ERRORS) == len(set(map(str, ERRORS))) >= 150


def test_planted_errors_are_python(root):
    for error in ERRORS:
        ast.parse((root / error.file).read_text("utf-8").replace(error.right, error.wrong), str(error))


def test_every_package_has_some(root):
    folders = {path.parent for path in (root / "forcegrasp").rglob("*.py") if path.stat().st_size}
    assert {root / error.file for error in ERRORS if (root / error.file).parent not in folders} == set()
    assert folders == {(root / error.file).parent for error in ERRORS}


@pytest.mark.parametrize(
    "text", ["- a\n+ b\n", "a.py | t\n- a\n- b\n", "a.py | t\n- a\n+ a\n", "a.py | t\n+ a\n", "a.py t\n"]
)
def test_a_line_that_is_none_is_named(text, tmp_path):
    (tmp_path / "one.txt").write_text(text)
    with pytest.raises(ValueError, match=r"one.txt, line \d: "):
        read_lists(tmp_path)


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """A checkout of one module, whose tests know half of it, and a list of errors."""
    files = {
        "toy.py": "def double(x):\n    return 2 * x\ndef half(x):\n    return x / 2\ndef minus(x):\n    return -x\n",
        "tests/toy/test_double.py": "from toy import double\n\n\ndef test_double():\n    assert double(3) == 6\n",
        "tests/toy/test_minus.py": "from toy import minus\n\n\ndef test_minus():\n    assert minus(3) == -3\n",
        "odd/test_odd.py": "def test_odd():\n    assert False\n",
    }
    planted = [("tests/toy/test_double.py", "2 * x", "3 * x"), ("tests/toy/test_double.py", "x / 2", "x / 3")]
    planted += [
        ("tests/toy/test_double.py", "return -x", "return x"),
        ("odd", "x / 2", "x * 2"),
        ("tests/toy", "return", "pass"),
    ]
    lines = [f"toy.py | {tests}\n- {right}\n+ {wrong}\n" for tests, right, wrong in planted]
    for name, text in {**files, "lists/toy.txt": "# a comment\n" + "\n".join(lines)}.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    subprocess.run(["git", "init", "--quiet", tmp_path], check=True)
    monkeypatch.setattr(judge, "HEAVY", ["pytest"])
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")  # they take longer than the tests
    monkeypatch.setattr(program, "ROOT", tmp_path)
    monkeypatch.setattr(program, "LISTS", tmp_path / "lists")
    return tmp_path


def test_verdicts(toy, capsys):
    results, table = toy / "build" / "results.json", toy / "table.md"
    arguments = ["--results", str(results), "--table", str(table)]
    before = (toy / "toy.py").read_text()
    assert program.main(arguments) == 1
    found = list(json.loads(results.read_text()).values())
    assert [one["verdict"] for one in found] == ["caught", "survived", "caught", "broken", "stale"]
    # what no named test notices, another one in its folder may
    assert [one["by"] for one in found[:3]] == [
        "tests/toy/test_double.py::test_double",
        "",
        "tests/toy/test_minus.py::test_minus",
    ]
    assert found[3]["by"] == "odd/test_odd.py fails without any error, too"
    assert found[4]["by"] == "stands there 3 times"
    printed = capsys.readouterr().out
    assert "SURVIVED toy.py: x / 2 → x / 3" in printed
    assert printed.endswith("2 of 5 caught (40.0%)\n")
    assert "|  | 5 | 2 |" in table.read_text()
    assert (toy / "toy.py").read_text() == before


def test_what_was_caught_is_not_tried_again(toy, capsys, monkeypatch):
    known = {str(error): vars(judge.Outcome("caught")) for error in read_lists(toy / "lists")}
    (toy / "results.json").write_text(json.dumps(known))
    monkeypatch.setattr(program, "Judge", None)
    assert program.main(["--results", str(toy / "results.json"), "--only", "2 * x"]) == 0
    assert capsys.readouterr().out.endswith("1 of 1 caught (100.0%)\n")


def test_tests_that_take_too_long_notice_nothing(toy):
    endless = judge.Judge(toy, timeout_s=0.001).judge(Error("toy.py", "2 * x", "3 * x", ("tests/toy/test_double.py",)))
    assert (endless.verdict, endless.by) == ("timeout", "more than 0.001 s")
