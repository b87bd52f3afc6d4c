"""However an option is typed, the same comes out: in brackets or not, plainly, by its other name."""

from __future__ import annotations

import os

import pytest

from forcegrasp.cli.options import SCHEMAS, compose, leaves, parse_override, spell_sweep
from forcegrasp.cli.spelling import quote, spell_out
from forcegrasp.cli.verbs import VERBS
from forcegrasp.config import DiagnoseConfig
from forcegrasp.errors import ConfigError

ALIKE = [
    ("evaluate", "policies", ["ib"], ["policies=[ib]", "policies=ib", "policies='ib'", "policy=ib", "policy=[ib]"]),
    ("render", "policies", ["runs/a b"], ["policies=[runs/a b]", "policy=runs/a b", "policies=runs/a b"]),
    ("render", "policies", ["runs/seed=0"], ["policies=['runs/seed=0']", "policy=runs/seed=0", "policies=runs/seed=0"]),
    ("evaluate", "policies", ["ib", "close"], ["policies=[ib,close]", "policy=[ib,close]"]),
    ("diagnose", "effects", ["backlash"], ["effects=[backlash]", "effects=backlash", "effect=backlash"]),
    ("record", "effects", ["stiction slip=1"], ["effects=['stiction slip=1']", "effect=stiction slip=1"]),
    ("add", "effect", "backlash", ["effect=backlash", "effects=backlash", "effects=[backlash]"]),
    ("train", "ppo.hidden", [8], ["ppo.hidden=[8]", "ppo.hidden=8"]),
    ("train", "observation.parts", ["force"], ["observation.parts=[force]", "observation.parts=force"]),
    ("compare", "data", ["my set's"], ["data='my set\\'s'", "my set's"]),
    ("fit", "data", ["seed=0"], ["data='seed=0'", "seed=0"]),
    ("diagnose", "data", ["runs/a", "b"], ["data=[runs/a,b]", "data=['runs/a', b]"]),
    ("curves", "folders", ["seed=0", "b"], ["folders=['seed=0',b]", "seed=0 folders=b"]),
    ("export", "run", "a", ["run=a", "a"]),
]  # fmt: skip


def spelled(verb: str, *typed: str) -> dict[str, object]:
    """Option → value, as Hydra reads what was typed."""
    defaults = {name: value for name, _, value in leaves(SCHEMAS[verb])}
    read = [parse_override(text) for text in spell_out(VERBS[verb], list(typed), defaults, parse_override)]
    return {one.get_key_element(): one.value() for one in read}


@pytest.mark.parametrize(("verb", "option", "value", "typed"), ALIKE, ids=[f"{a[0]} {a[3][0]}" for a in ALIKE])
def test_alike(verb, option, value, typed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    os.mkdir("seed=0")
    for text in typed:
        assert spelled(verb, *(text.split(" ") if verb == "curves" else [text])) == {option: value}


def test_every_verb_that_takes_something_by_position_takes_it_by_its_name():
    for verb in SCHEMAS:
        option, _ = VERBS[verb].positional
        if not option:
            continue
        assert spelled(verb, "a/b") in ({option: "a/b"}, {option: ["a/b"]})
        assert option in {name for name, _, _ in leaves(SCHEMAS[verb])}


def test_it_is_how_a_configuration_is_made():
    assert compose("diagnose", ["a set", "effect=backlash"]) == DiagnoseConfig(data=["a set"], effects=["backlash"])


@pytest.mark.parametrize("text", ["a", "it's", "a\\'b", "\\", "a\\b\\\\", "[a], {b}=3, ü", " a ", "'", '"'])
def test_quoted_text_is_read_to_the_letter(text):
    assert parse_override(f"x={quote(text)}").value() == text
    assert parse_override(f"x=[{quote(text)}]").value() == [text]


def test_values_of_a_sweep():
    typed = ["ppo.hidden=8,[16,16]", "observation.parts=force,position", "seed=0,1", "ppo.hidden=[8]"]
    spelled = ["ppo.hidden=[8],[16,16]", "observation.parts=[force],[position]", "seed=0,1", "ppo.hidden=[8]"]
    assert spell_sweep("train", typed) == spelled


def test_several_values_are_no_list():
    with pytest.raises(ConfigError, match=r"'policies=ib,close': several values; a list is written \[a,b\]"):
        compose("evaluate", ["policies=ib,close"])
