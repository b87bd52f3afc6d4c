"""YAML that others made is plain data, or refused with the row and what to do."""

from __future__ import annotations

import os

import pytest

from forcegrasp.files import plain_yaml
from forcegrasp.files.plain_yaml import PlainYamlError


@pytest.fixture
def file(tmp_path):
    return tmp_path / "x.yaml"


def test_what_is_said_is_read(file):
    file.write_text("\ufeffa: 1\nb: [1.5e-3, x, yes]\nc: {d: 007}\n", "utf-8")
    assert plain_yaml.load(file) == {"a": 1, "b": [0.0015, "x", True], "c": {"d": 7}}
    assert plain_yaml.load(file, text_only=True) == {"a": "1", "b": ["1.5e-3", "x", "yes"], "c": {"d": "007"}}


def test_many_lines_are_not_deep(file):
    file.write_text("".join(f"key_{number}: [{number}]\n" for number in range(200)))
    assert plain_yaml.load(file) == {f"key_{number}": [number] for number in range(200)}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("a: 1\nb: &x 2", "row 2: anchors"),
        ("a: 1\nb: *x", "row 2: anchors"),
        ("a: 1\n\nb: !!python/name:os.system", "row 3: the tag"),
        ("a: 1\nb: 2\na: 3", "row 3: 'a' stands there twice"),
        ("a: {b: {c: 1, c: 2}}", "row 1: 'c' stands there twice"),
        ("[a]: 1", "row 1: a key must be text"),
        ("a: " + "[" * 30, "row 1: nested too deeply"),
        ("a: 1" + ":59" * 100_000, "row 1: a value of 300001 characters"),
        ("a: 2024-13-99", "month must be in"),
        ("a: [", "row 1: "),
        ("a: \x00", "special characters"),
    ],
)
def test_more_than_plain_data_is_refused(file, text, told):
    file.write_text(text)
    with pytest.raises(PlainYamlError) as caught:
        plain_yaml.load(file)
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_no_endless_files(file):
    file.write_text("a: " + "x" * 1000)
    with pytest.raises(OSError, match="larger than 1 kB"):
        plain_yaml.load(file, max_bytes=1000)
    file.unlink()
    os.mkfifo(file)
    with pytest.raises(OSError, match="not an ordinary file"):
        plain_yaml.load(file)


def test_bytes_that_are_no_text_are_refused(file):
    file.write_bytes(b"a: 1\nb: \xff")
    with pytest.raises(PlainYamlError, match="row 2: not UTF-8"):
        plain_yaml.load(file)
