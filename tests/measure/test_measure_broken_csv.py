"""CSV files that are cut, renamed, re-encoded, or have a wrong cell: file, row and column are named."""

from __future__ import annotations

from pathlib import Path

import pytest
from measured_rig import edit, refuse

from forcegrasp.measure import read_set
from forcegrasp.measure.schema import OBJECT, TWO_FINGERS

BAD_NUMBERS = {
    "a word": "abc",
    "nan": "nan",
    "NaN": "NaN",
    "inf": "inf",
    "-inf": "-Infinity",
    "#N/A": "#N/A",
    "null": "null",
    "True": "True",
    "unit": "0.1 m",
    "hex": "0x10",
    "underscore": "1_000",
    "thousands": "1.000.000",
    "unicode minus": "−0.1",
    "full-width": "１",
    "two numbers": "0.1 0.2",
    "overflow": "1e999",
    "Fortran": "1d-3",
    "decimal in quotes": '"0;1"',
    "formula": "=A1",
    "space after": "0.1 ",
}


@pytest.mark.parametrize("column", [*TWO_FINGERS.signals, OBJECT])
@pytest.mark.parametrize("case", BAD_NUMBERS)
def test_number(folder, column, case):
    edit(folder / "samples.csv", 42, column, BAD_NUMBERS[case])
    refuse(folder, "samples.csv", "row 42", f"column {column}")


@pytest.mark.parametrize("column", TWO_FINGERS.signals)
def test_empty_number(folder, column):
    edit(folder / "samples.csv", 601, column, "")
    refuse(folder, "samples.csv", "row 601", f"column {column}", "empty")


def test_object_position_partly_there(folder):
    edit(folder / "samples.csv", 77, OBJECT, "")
    refuse(folder, "samples.csv", "row 77", f"column {OBJECT}", "empty")


@pytest.mark.parametrize("case", BAD_NUMBERS)
@pytest.mark.parametrize("column", ["object_radius_m", "object_offset_m"])
def test_number_of_a_grasp(folder, column, case):
    edit(folder / "grasps.csv", 4, column, BAD_NUMBERS[case])
    refuse(folder, "grasps.csv", "row 4", f"column {column}")


@pytest.mark.parametrize("radius", ["0", "-0.02", "-0"])
def test_radius(folder, radius):
    edit(folder / "grasps.csv", 3, "object_radius_m", radius)
    refuse(folder, "grasps.csv", "row 3", "object_radius_m", "positive")


@pytest.mark.parametrize("mass", ["0", "-0.2"])
def test_mass(folder, mass):
    path = folder / "grasps.csv"
    head, *rows = path.read_text().strip().split("\n")
    path.write_text("\n".join([f"{head},object_mass_kg", *(f"{row},0.3" for row in rows)]) + "\n")
    assert {grasp.mass_kg for grasp in read_set(folder).grasps} == {0.3}
    edit(path, 3, "object_mass_kg", mass)
    refuse(folder, "grasps.csv", "row 3", "object_mass_kg", "positive")


BAD_NAMES = {
    "empty": "",
    "quoted empty": '""',
    "long": "x" * 101,
    "bell": "a\x07b",
    "zero width": "a\u200bb",
    "line separator": "a\u2028b",
    "space before": " a",
    "space after": "a ",
    "no-break space": "a\u00a0",
    "a space": " ",
    "tab": "a\tb",
    "quote within": 'a"b',
    "quote left open": '"a',
    "text after a quote": '"a"b',
}


@pytest.mark.parametrize("case", BAD_NAMES)
@pytest.mark.parametrize("column", ["grasp", "object", "session"])
def test_name(folder, column, case):
    edit(folder / "grasps.csv", 5, column, BAD_NAMES[case])
    parts = () if "quote" in case and case != "quoted empty" else (f"column {column}",)
    refuse(folder, "grasps.csv", "row 5", *parts)


@pytest.mark.parametrize("case", BAD_NAMES)
def test_name_in_samples(folder, case):
    edit(folder / "samples.csv", 300, "grasp", BAD_NAMES[case])
    refuse(folder, "samples.csv", *(() if "quote" in case else ("row 300", "column grasp")))


@pytest.mark.parametrize("split", ["train", "Fit", "test", "fit;check", "0", "checks"])
def test_split(folder, split):
    edit(folder / "grasps.csv", 2, "split", split)
    refuse(folder, "grasps.csv", "row 2", "column split")


@pytest.mark.parametrize("file", ["grasps.csv", "samples.csv"])
@pytest.mark.parametrize("change", ["drop", "misspell", "twice", "capitals", "space", "empty"])
def test_each_column(folder, file, change):
    lines = (folder / file).read_text().split("\n")
    header = lines[0].split(",")
    for index, name in enumerate(header):
        if change == "drop":
            if name in ("split", "object_offset_m", OBJECT):
                continue
            rows = [",".join(c for i, c in enumerate(line.split(",")) if i != index) for line in lines]
            expected = [f"missing columns: {name};"]
        else:
            new = {
                "misspell": name + "x",
                "twice": header[index - 1],
                "capitals": name.upper(),
                "space": f" {name}",
                "empty": "",
            }[change]
            rows = [",".join(new if i == index else c for i, c in enumerate(header)), *lines[1:]]
            expected = ["twice"] if change == "twice" else ["unknown columns: "]
        (folder / file).write_text("\n".join(rows))
        refuse(folder, file, "row 1", *expected)


def _bytes(change):
    return lambda path: path.write_bytes(change(path.read_bytes()))


def _lines(change):
    def spoil(path: Path) -> None:
        lines = path.read_text().split("\n")
        change(lines)
        path.write_text("\n".join(lines))

    return spoil


SPOILT = {
    "empty": (_bytes(lambda b: b""), []),
    "header only": (_bytes(lambda b: b.split(b"\n")[0] + b"\n"), ["no rows"]),
    "no header": (_bytes(lambda b: b.split(b"\n", 1)[1]), ["row 1"]),
    "UTF-16": (_bytes(lambda b: b.decode().encode("utf-16")), ["row 1", "UTF-16"]),
    "UTF-16 without a mark": (_bytes(lambda b: b.decode().encode("utf-16-le")), ["row 1"]),
    "UTF-32": (_bytes(lambda b: b.decode().encode("utf-32")), ["row 1"]),
    "NUL in row 4": (_lines(lambda t: t.__setitem__(3, t[3] + "\0")), ["row 4", "NUL"]),
    "semicolons": (_bytes(lambda b: b.replace(b",", b";")), ["row 1", "commas"]),
    "tabs": (_bytes(lambda b: b.replace(b",", b"\t")), ["row 1", "commas"]),
    "decimal commas": (_bytes(lambda b: b.replace(b".", b",")), ["row "]),
    "CR alone": (_bytes(lambda b: b.replace(b"\n", b"\r")), ["row 1", "CR"]),
    "blank line": (_lines(lambda t: t.insert(2, "")), ["row 3", "empty"]),
    "two blank lines": (_lines(lambda t: t.__setitem__(slice(3, 3), ["", ""])), ["row 4", "empty"]),
    "blank first line": (_lines(lambda t: t.insert(0, "")), ["row 1"]),
    "comment line": (_lines(lambda t: t.insert(0, "# recorded by me")), ["row 1"]),
    "comment among rows": (_lines(lambda t: t.insert(4, "# pause")), ["row 5", "cells"]),
    "unit line": (_lines(lambda t: t.insert(1, ",".join(["m"] * len(t[0].split(","))))), ["row 2"]),
    "header again": (_lines(lambda t: t.insert(5, t[0])), ["row 6"]),
    "short row": (_lines(lambda t: t.__setitem__(3, t[3].rsplit(",", 1)[0])), ["row 4", "cells"]),
    "long row": (_lines(lambda t: t.__setitem__(3, t[3] + ",1")), ["row 4", "cells"]),
    "commas at the ends": (_bytes(lambda b: b.replace(b"\n", b",\n")), ["row 1"]),
    "cut in a row": (_lines(lambda t: t.__setitem__(slice(None), [*t[:-2], t[-2][:3]])), ["cells"]),
    "quote left open": (_lines(lambda t: t.__setitem__(2, '"' + t[2])), ["row 3", "quotation"]),
    "quote across lines": (_lines(lambda t: t.__setitem__(2, '"a\nb"' + t[2][2:])), ["row 3", "quotation"]),
    "endless line": (_bytes(lambda b: b + b"1" * 50_000), ["longer"]),
    "endless header": (_bytes(lambda b: b"a," * 30_000 + b), ["row 1", "longer"]),
    "binary": (_bytes(lambda b: bytes(range(256)) * 50), ["row"]),
    "zip": (_bytes(lambda b: b"PK\x03\x04" + bytes(100)), ["row 1"]),
    "gzip": (_bytes(lambda b: b"\x1f\x8b\x08\x00" + bytes(range(128, 200))), ["UTF-8"]),
    "a Parquet file": (_bytes(lambda b: b"PAR1" + bytes(60) + b"PAR1"), ["row 1"]),
    "JSON": (_bytes(lambda b: b'{"grasp": [1, 2, 3]}'), ["row 1"]),
    "HTML": (_bytes(lambda b: b"<!DOCTYPE html>\n<html></html>"), ["row 1"]),
    "newlines": (_bytes(lambda b: b"\n" * 1000), ["empty"]),
    "commas": (_bytes(lambda b: b"," * 1000), ["row 1"]),
    "quotes": (_bytes(lambda b: b'"' * 1001), ["row 1"]),
    "conflict marks": (_lines(lambda t: t.insert(3, "<<<<<<< HEAD")), ["row 4"]),
}


@pytest.mark.parametrize("file", ["grasps.csv", "samples.csv"])
@pytest.mark.parametrize("case", SPOILT)
def test_file(folder, file, case):
    spoil, parts = SPOILT[case]
    spoil(folder / file)
    refuse(folder, file, *parts)


@pytest.mark.parametrize("row", [1, 2, 7])
@pytest.mark.parametrize("file", ["grasps.csv", "samples.csv"])
def test_latin_1(folder, file, row):
    lines = (folder / file).read_bytes().split(b"\n")
    lines[row - 1] += b"\xe9"
    (folder / file).write_bytes(b"\n".join(lines))
    refuse(folder, file, f"row {row}", "UTF-8")


def test_bytes_late_in_a_large_file(folder, monkeypatch):
    monkeypatch.setattr("forcegrasp.measure.csv_file._CHUNK", 101)
    clean = read_set(folder).fingerprint
    lines = (folder / "samples.csv").read_bytes().split(b"\n")
    (folder / "samples.csv").write_bytes(b"\n".join([*lines, b"", b""]))
    assert read_set(folder).fingerprint == clean
    for spoilt, word in ((b"\xff", "UTF-8"), (b"\0", "NUL")):
        (folder / "samples.csv").write_bytes(b"\n".join([*lines[:399], spoilt + lines[399], *lines[400:]]))
        refuse(folder, "row 400", word)


def test_grasp_twice(folder):
    lines = (folder / "grasps.csv").read_text().split("\n")
    (folder / "grasps.csv").write_text("\n".join([*lines[:4], lines[2], *lines[4:]]))
    refuse(folder, "grasps.csv", "row 5", "column grasp", "row 3")


def test_grasp_without_samples(folder):
    lines = (folder / "samples.csv").read_text().split("\n")
    (folder / "samples.csv").write_text("\n".join(line for line in lines if not line.startswith("g3,")))
    refuse(folder, "grasps.csv", "row 5", "'g3'", "no samples")


def test_samples_without_grasp(folder):
    lines = (folder / "grasps.csv").read_text().split("\n")
    (folder / "grasps.csv").write_text("\n".join(line for line in lines if not line.startswith("g2,")))
    refuse(folder, "samples.csv", "row 202", "column grasp", "'g2'", "not in grasps.csv")


def test_unknown_grasp_names_the_closest(folder):
    edit(folder / "samples.csv", 9, "grasp", "g00")
    refuse(folder, "samples.csv", "row 9", "column grasp", "did you mean g0")


TIMES = {
    "runs back": (lambda t: "0.0001", "runs back"),
    "negative": (lambda t: "-5", "runs back"),
    "twice": (lambda t: t, "twice"),
}


@pytest.mark.parametrize("case", TIMES)
@pytest.mark.parametrize("row", [4, 50, 101, 250, 600])
def test_time(folder, case, row):
    before = (folder / "samples.csv").read_text().split("\n")[row - 2].split(",")[1]
    make, word = TIMES[case]
    edit(folder / "samples.csv", row, "t_s", make(before))
    refuse(folder, "samples.csv", f"row {row}", "column t_s", word)


def test_row_twice(folder):
    lines = (folder / "samples.csv").read_text().split("\n")
    (folder / "samples.csv").write_text("\n".join([*lines[:60], lines[59], *lines[60:]]))
    refuse(folder, "samples.csv", "row 61", "same row")


def test_file_twice_in_a_row(folder):
    header, rows = (folder / "samples.csv").read_text().split("\n", 1)
    (folder / "samples.csv").write_text(f"{header}\n{rows}{rows}")
    refuse(folder, "samples.csv", "row 602", "time runs back")


def test_rows_in_reverse(folder):
    header, *rows = (folder / "samples.csv").read_text().strip().split("\n")
    (folder / "samples.csv").write_text("\n".join([header, *rows[::-1]]))
    refuse(folder, "samples.csv", "column t_s", "time runs back")


def test_row_numbers_of_interleaved_rows(folder):
    header, *rows = (folder / "samples.csv").read_text().strip().split("\n")
    mixed = [row for rank in range(100) for row in rows[rank::100]]
    (folder / "samples.csv").write_text("\n".join([header, *mixed]))
    read_set(folder)
    mixed[310], mixed[316] = mixed[316], mixed[310]  # of the same grasp, one step apart
    (folder / "samples.csv").write_text("\n".join([header, *mixed]))
    refuse(folder, "samples.csv", "row 318", "time runs back")


def test_carriage_return_within_a_cell(folder):
    edit(folder / "grasps.csv", 3, "object", "spo\rnge")
    refuse(folder, "grasps.csv", "row 3")


def test_file_that_ends_within_a_character(folder):
    path = folder / "grasps.csv"
    path.write_bytes(path.read_bytes() + "g9,ä".encode()[:-1])
    refuse(folder, "grasps.csv", "ends within a character")
