"""A verb is a file and a line: what else it needs, these tests and those that go through VERBS say."""

from __future__ import annotations

import importlib
import re
import runpy
from pathlib import Path

import pytest

from forcegrasp.cli.options import leaves
from forcegrasp.cli.verb import Verb
from forcegrasp.cli.verbs import VERBS
from forcegrasp.config import validate

TESTS = Path(__file__).parents[1]


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_is_the_file_of_its_name(name):
    verb = VERBS[name]
    assert importlib.import_module(f"forcegrasp.cli.{name}").VERB is verb
    assert verb.name == name
    assert len(verb.purpose) <= 100
    assert not re.search(r"^[A-Z]|\.$", verb.purpose), "it stands in a list, without a full stop"
    assert isinstance(verb, Verb)


@pytest.mark.parametrize("verb", [verb for verb in VERBS.values() if verb.schema], ids=lambda verb: verb.name)
def test_its_options_are_shown_to_change_something(verb):
    validate(verb.schema())
    option, word = verb.positional
    assert bool(option) == bool(word)
    assert not option or option in {name for name, _, _ in leaves(verb.schema)}
    tests = "".join(path.read_text("utf-8") for path in (TESTS / "config").glob("test_options_of_*.py"))
    assert verb.schema.__name__ in tests, "tests/config/test_options_of_small_verbs.py wants a case for each option"


@pytest.mark.parametrize(("argument", "status"), [("--version", 0), ("no_verb", 2)])
def test_the_module_exits_as_the_program_does(argument, status, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["forcegrasp", argument])
    with pytest.raises(SystemExit) as ended:
        runpy.run_module("forcegrasp", run_name="__main__")
    assert ended.value.code == status


def test_usage_follows_from_what_a_verb_takes():
    lines = {name: verb.usage_line.removeprefix("usage: forcegrasp ") for name, verb in VERBS.items()}
    assert lines["fit"] == "fit [SET ...] [key=value ...]"
    assert lines["curves"] == "curves [FOLDER ...] [key=value ...]"
    assert lines["record"] == "record [key=value ...]"
    assert lines["effects"] == "effects [NAME] [gripper=GRIPPER]"
    assert lines["completion"] == "completion [bash|zsh|fish]"
