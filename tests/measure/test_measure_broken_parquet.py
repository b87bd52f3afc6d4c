"""Parquet files that are cut, lie about their size, or hold other types than text and numbers."""

from __future__ import annotations

import random

import numpy as np
import polars as pl
import pytest
from measured_rig import refuse

from forcegrasp.errors import MeasurementError
from forcegrasp.measure import read_set
from forcegrasp.measure.parquet_footer import Footer, read_footer
from forcegrasp.measure.schema import OBJECT, TWO_FINGERS


@pytest.fixture
def parquet(folder, valid_files):
    """A valid set whose samples are in Parquet."""
    (folder / "samples.csv").unlink()
    (folder / "samples.parquet").write_bytes(valid_files["samples.parquet"])
    return folder


def _rewrite(folder, *expressions, **options) -> None:
    file = folder / "samples.parquet"
    pl.read_parquet(file).with_columns(*expressions).write_parquet(file, **options)


@pytest.mark.parametrize("share", [0.0, 0.0001, 0.001, 0.01, 0.1, 0.5, 0.9, 0.99, 0.9999])
def test_cut(parquet, share):
    data = (parquet / "samples.parquet").read_bytes()
    (parquet / "samples.parquet").write_bytes(data[: int(share * len(data))])
    refuse(parquet, "samples.parquet", "not a whole Parquet file")


@pytest.mark.parametrize("share", [0.0001, 0.1, 0.5, 0.9])
def test_without_its_start(parquet, share):
    data = (parquet / "samples.parquet").read_bytes()
    (parquet / "samples.parquet").write_bytes(data[int(share * len(data)) + 1 :])
    refuse(parquet, "samples.parquet")


@pytest.mark.parametrize("more", [-1, 1])
def test_other_rows_than_its_footer_says(parquet, more, monkeypatch):
    true = read_footer(parquet / "samples.parquet")
    said = Footer(true.rows + more, true.bytes)
    monkeypatch.setattr("forcegrasp.measure.parquet_file.read_footer", lambda path: said)
    refuse(parquet, "samples.parquet", f"{true.rows} rows where its footer says {said.rows}")


OTHERS = {
    "CSV": b"grasp,t_s\n" * 10,
    "random": random.Random(0).randbytes(5000),
    "magic only": b"PAR1PAR1",
    "zeros between magic": b"PAR1" + bytes(100) + b"PAR1",
    "ones between magic": b"PAR1" + b"\xff" * 100 + b"PAR1",
    "footer of 4 GB": b"PAR1" + bytes(100) + b"\xff\xff\xff\xff" + b"PAR1",
    "endless struct": b"PAR1" + b"\x1c" * 300 + (300).to_bytes(4, "little") + b"PAR1",
    "endless list": b"PAR1" + b"\x19\xfc\xff\xff\xff\xff\x0f" + (7).to_bytes(4, "little") + b"PAR1",
    "endless number": b"PAR1" + b"\x16" + b"\xff" * 200 + (201).to_bytes(4, "little") + b"PAR1",
    "encrypted": b"PARE" + bytes(100) + b"PARE",
    "feather": b"ARROW1" + bytes(100) + b"ARROW1",
    "HDF5": b"\x89HDF\r\n\x1a\n" + bytes(100),
}


@pytest.mark.parametrize("case", OTHERS)
def test_no_parquet(parquet, case):
    (parquet / "samples.parquet").write_bytes(OTHERS[case])
    refuse(parquet, "samples.parquet", "not a whole Parquet file")


def test_footer_of_3_mb(parquet):
    (parquet / "samples.parquet").write_bytes(bytes(3_000_000) + (3_000_000).to_bytes(4, "little") + b"PAR1")
    refuse(parquet, "footer")


def _varint(value: int) -> bytes:
    value, out = value * 2, b""
    while value > 127:
        out, value = out + bytes([value & 127 | 128]), value >> 7
    return out + bytes([value])


@pytest.mark.parametrize(("rows", "size", "word"), [(10**12, 1, "rows"), (9, 10**13, "GB"), (20_000_001, 1, "rows")])
def test_claims_to_be_huge(parquet, rows, size, word):
    """Refused from the footer alone, before any reader allocates what it claims."""
    group = b"\x26" + _varint(size) + b"\x00"  # field 2, i64
    meta = b"\x36" + _varint(rows) + b"\x19\x1c" + group + b"\x00"  # field 3, i64; field 4, list of one struct
    file = parquet / "samples.parquet"
    file.write_bytes(b"PAR1" + meta + len(meta).to_bytes(4, "little") + b"PAR1")
    refuse(parquet, "samples.parquet", word)


def test_zeros_that_unpack_to_5_gb(parquet):
    file = parquet / "samples.parquet"
    pl.DataFrame({name: np.zeros(1000) for name in TWO_FINGERS.signals}).write_parquet(file)
    assert read_footer(file).rows == 1000
    assert 0 < read_footer(file).bytes < 100_000
    pl.DataFrame({"t_s": pl.Series([0.0]).new_from_index(0, 21_000_000)}).write_parquet(file)
    assert file.stat().st_size < 1_000_000
    refuse(parquet, "21,000,000 rows")


@pytest.mark.parametrize("row_group", [7, 100, 600])
def test_footer_agrees_with_polars(parquet, row_group):
    _rewrite(parquet, row_group_size=row_group)
    assert read_footer(parquet / "samples.parquet").rows == 600
    assert len(read_set(parquet).grasps) == 6


@pytest.mark.parametrize("column", [*TWO_FINGERS.signals, OBJECT])
@pytest.mark.parametrize("value", [None, float("nan"), float("inf"), float("-inf")])
def test_number(parquet, column, value):
    if column == OBJECT and value is None:
        return  # tested below: not measured is not wrong
    cell = pl.when(pl.int_range(pl.len()) == 122).then(pl.lit(value)).otherwise(pl.col(column)).alias(column)
    _rewrite(parquet, cell)
    refuse(parquet, "samples.parquet", "row 123", f"column {column}")


TYPES = {
    "text": pl.String,
    "boolean": pl.Boolean,
    "date": pl.Date,
    "time stamp": pl.Datetime("us"),
    "duration": pl.Duration("us"),
    "decimal": pl.Decimal(30, 9),
    "category": pl.Categorical,
    "binary": pl.Binary,
}


@pytest.mark.parametrize("column", ["t_s", "q_l_m", OBJECT])
@pytest.mark.parametrize("case", TYPES)
def test_type(parquet, column, case):
    kind = TYPES[case]
    through = {
        "binary": pl.String,
        "category": pl.String,
        "date": pl.Int32,
        "time stamp": pl.Int64,
        "duration": pl.Int64,
    }
    expression = pl.col(column).cast(through[case]) if case in through else pl.col(column)
    _rewrite(parquet, expression.cast(kind).alias(column))
    refuse(parquet, "samples.parquet", f"column {column}", "numbers")


@pytest.mark.parametrize("nested", [pl.concat_list, pl.struct])
@pytest.mark.parametrize("column", ["t_s", "f_r_n"])
def test_nested(parquet, column, nested):
    _rewrite(parquet, nested(column).alias(column))
    refuse(parquet, "samples.parquet", f"column {column}", "numbers")


@pytest.mark.parametrize("kind", [pl.Float64, pl.Boolean, pl.Binary, pl.Date])
def test_type_of_names(parquet, kind):
    names = {pl.Binary: pl.lit("g0"), pl.Date: pl.lit(0), pl.Boolean: pl.lit(True), pl.Float64: pl.lit(0.0)}[kind]
    _rewrite(parquet, names.cast(kind).alias("grasp"))
    refuse(parquet, "column grasp", "text")


@pytest.mark.parametrize("value", ["", None, "x" * 101, "a\nb", " g1", "g1 ", "\u202eg1"])
def test_name(parquet, value):
    _rewrite(parquet, pl.when(pl.int_range(pl.len()) == 9).then(pl.lit(value)).otherwise("grasp").alias("grasp"))
    refuse(parquet, "row 10", "column grasp")


def test_columns(parquet):
    whole = pl.read_parquet(parquet / "samples.parquet")
    for name in ("grasp", *TWO_FINGERS.signals):
        whole.drop(name).write_parquet(parquet / "samples.parquet")
        refuse(parquet, f"missing columns: {name};")
        whole.rename({name: f"{name}_"}).write_parquet(parquet / "samples.parquet")
        refuse(parquet, f"'{name}_'", "did you mean")


def test_no_rows(parquet):
    pl.read_parquet(parquet / "samples.parquet").head(0).write_parquet(parquet / "samples.parquet")
    refuse(parquet, "no rows")


def test_time(parquet):
    _rewrite(parquet, pl.when(pl.int_range(pl.len()) == 150).then(0.0).otherwise("t_s").alias("t_s"))
    refuse(parquet, "samples.parquet", "row 151", "column t_s", "runs back")


def test_bytes_changed(parquet, capfd):
    """Whatever byte is wrong: read, or refused in one line, with nothing on stderr."""
    file = parquet / "samples.parquet"
    data, draw = file.read_bytes(), random.Random(3)
    for _ in range(150):
        spoilt = bytearray(data)
        spoilt[draw.randrange(max(0, len(data) - 3000), len(data))] = draw.randrange(256)
        file.write_bytes(spoilt)
        try:
            read_set(parquet)
        except MeasurementError as error:
            assert str(error).isprintable()  # noqa: PT017
    assert capfd.readouterr().err == ""
