"""meta.yaml: whatever is not as it must be is refused in one line."""

from __future__ import annotations

import pytest
from measured_rig import refuse

from forcegrasp.measure import read_set
from forcegrasp.measure.read import Meta

VALID = {
    "format": "forcegrasp-measurements/1",
    "kind": "grasps",
    "gripper": "tiago",
    "source": "me",
    "license": "CC0",
}


NEEDED = ("format", "kind", "gripper")


def _text(**changes: str | None) -> str:
    facts = VALID | changes
    return "".join(f"{key}: {value}\n" for key, value in facts.items() if value is not None)


TEXTS = {
    **{f"no {key}": (_text(**{key: None}), [key]) for key in NEEDED},
    **{f"empty {key}": (_text(**{key: ""}), [key]) for key in NEEDED},
    **{f"null {key}": (_text(**{key: "null"}), [key]) for key in NEEDED},
    **{f"list for {key}": (_text(**{key: "[a, b]"}), [key]) for key in VALID},
    **{f"mapping for {key}": (_text(**{key: "{a: b}"}), [key]) for key in VALID},
    **{f"too long {key}": (_text(**{key: "x" * 20_000}), [key]) for key in VALID},
    **{f"control character in {key}": (_text(**{key: '"a\\x01b"'}), [key]) for key in VALID},
    **{
        f"{key} is {value}": (_text(**{key: value}), [key])
        for key in ("position_std_m", "force_std_n", "period_std_share", "delay_std_s")
        for value in (
            "-1",
            "0",
            "nan",
            ".nan",
            ".inf",
            "inf",
            "much",
            "0,01",
            "[1]",
            "{a: 1}",
            "1e999",
            "0x1",
            "1_0",
            "yes",
        )
    },
    "percent for a share": (
        _text(period_std_share="0.3"),
        ["period_std_share: 0.3 is no share"],
    ),
    "milliseconds": (_text(delay_std_s="2"), ["delay_std_s: 2 s is too long; looks like milliseconds"]),
    "format of the future": (_text(format="forcegrasp-measurements/2"), ["forcegrasp-measurements/1"]),
    "format in capitals": (_text(format="Forcegrasp-Measurements/1"), ["format"]),
    "kind misspelt": (_text(kind="grasp"), ["did you mean grasps"]),
    "kind of two": (_text(kind="grasps final_force"), ["kind"]),
    "kind in capitals": (_text(kind="GRASPS"), ["kind"]),
    "key misspelt": (_text(licence="CC0", license=None), ["licence: unknown", "did you mean license"]),
    "unknown key": (_text(robot="tiago"), ["robot: unknown"]),
    "key with unit": (_text(force_std_mn="13"), ["force_std_mn: unknown", "force_std_n"]),
    "key twice": (_text() + "kind: final_force\n", ["row 6", "'kind'", "twice"]),
    "empty": ("", []),
    "a comment": ("# nothing\n", []),
    "a word": ("grasps\n", []),
    "a list": ("- a\n- b\n", []),
    "two documents": (_text() + "---\n" + _text(), ["row 6"]),
    "key of a list": ("[a, b]: c\n" + _text(), ["row 1"]),
    "no space after the colon": ("format:forcegrasp-measurements/1\nkind:grasps\n", []),
    "tabs": ("format: x\n\tkind: grasps\n", ["row 2"]),
    "bracket left open": ("format: [a\n", []),
    "quote left open": ('format: "a\n', []),
    "python object": (_text(source="!!python/object/apply:os.system ['true']"), ["row 4", "tag"]),
    "python name": (_text(source="!!python/name:os.system ''"), ["row 4", "tag"]),
    "tag for text": (_text(gripper="!!str tiago"), ["row 3", "tag"]),
    "tag for a number": (_text(force_std_n="!!float 0.1"), ["row 6", "tag"]),
    "own tag": (_text(source="!mine x"), ["row 4", "tag"]),
    "anchor": (_text(gripper="&a tiago"), ["row 3", "anchors"]),
    "alias": (_text(gripper="*a"), ["row 3"]),
    "laughs": ("a: &a [x,x]\nb: &b [*a,*a]\nc: [*b,*b]\n", ["row 1"]),
    "merge": (_text() + "<<: {kind: grasps}\n", ["<<"]),
    "deep": (_text(source="[" * 5000), []),
    "deep mapping": (_text(source="{a: " * 5000), []),
    "long": (_text() + "# " + "x" * 200_000, ["kB"]),
    "control character": (_text() + "\x07", []),
    "NUL": (_text() + "\0", []),
    "JSON lines": ('{"format": 1}\n{"kind": 2}\n', []),
    "HTML": ("<!DOCTYPE html><html>: </html>", []),
    "directive": ("%YAML 9.9\n---\n" + _text(), []),
    "conflict": ("<<<<<<< HEAD\n" + _text() + "=======\n", []),
}


@pytest.mark.parametrize("case", TEXTS)
def test_text(folder, case):
    text, parts = TEXTS[case]
    (folder / "meta.yaml").write_text(text)
    refuse(folder, "meta.yaml", *parts)


@pytest.mark.parametrize("key", ["source", "license"])
@pytest.mark.parametrize("value", [None, "", "null", "''"])
def test_where_a_set_comes_from_may_be_left_out(folder, key, value):
    (folder / "meta.yaml").write_text(_text(**{key: value}))
    assert getattr(read_set(folder), key) == ""


BYTES = {
    "UTF-16": (_text().encode("utf-16"), ["row 1", "UTF-8"]),
    "Latin-1": (_text(source="Jürgen").encode("latin-1"), ["row 4", "UTF-8"]),
    "random": (bytes(range(256)) * 10, []),
    "PNG": (b"\x89PNG\r\n\x1a\n" + bytes(100), ["UTF-8"]),
    "zip": (b"PK\x03\x04" + bytes(range(200, 256)), []),
}


@pytest.mark.parametrize("case", BYTES)
def test_bytes(folder, case):
    data, parts = BYTES[case]
    (folder / "meta.yaml").write_bytes(data)
    refuse(folder, "meta.yaml", *parts)


def test_positions_in_a_table_of_forces(folder):
    (folder / "meta.yaml").write_text(_text(kind="final_force", position_std_m="1e-5"))
    refuse(folder, "position_std_m")


def test_all_wrong_keys_are_told_at_once(folder):
    (folder / "meta.yaml").write_text("format: forcegrasp-measurements/1\nkid: grasps\nforce_std_n: much\na: 1\nb: 2\n")
    refuse(folder, "kid: unknown; did you mean kind", "kind: missing", "gripper: missing", "1 more")


def test_keys_that_must_be_there():
    assert [key for key, field in Meta.model_fields.items() if field.is_required()] == list(NEEDED)
