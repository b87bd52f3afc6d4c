"""Ways to spoil a file: changed bytes, cells and lines of a CSV, columns of a Parquet file, odd YAML."""

from __future__ import annotations

import io
from collections.abc import Callable

import numpy as np
import polars as pl

Rng = np.random.Generator

_BYTES = [
    b"\n",
    b",",
    b'"',
    b"\r",
    b"\xff",
    b"nan",
    b"-",
    b"1e999",
    b": ",
    b"\0",
    b"\xef\xbb\xbf",
    b"\t",
    b"[",
    b"&a ",
    b"*a",
]
_ODD_CELLS = '|| |abc|nan|inf|-inf|1e999|1,5|0x1p3|1_000|--1|1e|١٢|\u202e1|\'|"|""|"a|=1+1|NULL|1 2|\x07|-0|true'
_ODD_VALUES = (
    "# ~# []# {}# [1, [2]]# {a: 1}# yes# nan# .inf# -1# 0# 1e999# 1e-400# 0x10# 1_0# 2024-13-99# 12:30:45# |# >"
    "# !!python/name:os.system# !!binary aGk=# &a b# *a# <<: {a: 1}# '# \"# - -# ? a# %YAML 9# ---# @# `# \x85"
)
#: What a cell may say instead: no numbers, numbers that can't be, text that is hard to show.
_CELLS = [*_ODD_CELLS.split("|"), "9" * 400, "x" * 20_000, "../../x", "<b>"]
#: What a value in YAML may say instead.
_VALUES = [
    *_ODD_VALUES.split("#"),
    "9" * 5000,
    "x" * 20_000,
    "[" * 100,
    "{a: " * 50,
    "\u202eabc",
    "tiago\nkind: grasps",
]


def spoil_bytes(data: bytes, rng: Rng) -> bytes:
    """Changes, adds, repeats or drops bytes, in one to four places; or cuts the file."""
    for _ in range(int(rng.integers(1, 5))):
        at, length = int(rng.integers(len(data) + 1)), int(rng.integers(1, 9))
        match int(rng.integers(6)):
            case 0:
                data = data[:at] + rng.bytes(length) + data[at + length :]
            case 1:
                data = data[:at] + rng.bytes(length) + data[at:]
            case 2:
                data = data[:at] + data[at + 10 * length :]
            case 3:
                data = data[:at] + _BYTES[rng.integers(len(_BYTES))] + data[at + length :]
            case 4:
                data = data[:at] + data[at : at + 30 * length] + data[at:]
            case _:
                flipped = bytearray(data)
                if flipped:
                    flipped[at % len(flipped)] ^= 1 << int(rng.integers(8))
                data = bytes(flipped)
    return data[: int(rng.integers(len(data) + 1))] if rng.random() < 0.1 else data


def spoil_cell(data: bytes, rng: Rng) -> bytes:
    """Gives one cell below the header another content."""
    lines = data.decode().splitlines()
    row = int(rng.integers(1, len(lines)))
    cells = lines[row].split(",")
    cells[rng.integers(len(cells))] = _CELLS[rng.integers(len(_CELLS))]
    lines[row] = ",".join(cells)
    return "\n".join(lines).encode() + b"\n"


def spoil_lines(data: bytes, rng: Rng) -> bytes:
    """Loses, repeats, exchanges or cuts lines and columns, or writes them in another way."""
    rows = [line.split(",") for line in data.decode().splitlines()]
    one, other = (int(n) for n in rng.integers(0, len(rows), 2))
    column = int(rng.integers(len(rows[0])))
    separator, ends, encoding = ",", "\n", "utf-8"
    match int(rng.integers(14)):
        case 0:
            del rows[one]
        case 1:
            rows.insert(other, rows[one])
        case 2:
            rows[one], rows[other] = rows[other], rows[one]
        case 3:
            rows[one] = rows[one][:column]
        case 4:
            rows[one] = rows[one] + rows[other]
        case 5:
            rows = [row[:column] + row[column + 1 :] for row in rows]
        case 6:
            rows = [[*row, row[column]] for row in rows]
        case 7:
            rows[0][column] = _CELLS[rng.integers(len(_CELLS))]
        case 8:
            separator = str(rng.choice([";", "\t", "|", " ", ", ", ",,"]))
        case 9:
            ends = str(rng.choice(["\r", "\r\n", "\n\n", "\n\r", "\x0b", "\u2028"]))
        case 10:
            encoding = str(rng.choice(["utf-16", "utf-8-sig", "utf-32", "utf-7"]))
        case 11:
            rows = rows[:1]
        case 12:
            rows[one] = [f'"{cell}"' for cell in rows[one]]
        case _:
            scale = float(rng.choice([0, -1, 1e-3, 1e3, 1e300]))
            rows[1:] = [
                [_scaled(cell, scale) if k == column else cell for k, cell in enumerate(row)] for row in rows[1:]
            ]
    return (ends.join(separator.join(row) for row in rows) + ends).encode(encoding)


def _scaled(cell: str, scale: float) -> str:
    try:
        return repr(float(cell) * scale)
    except ValueError:
        return cell


def spoil_parquet(data: bytes, rng: Rng) -> bytes:
    """Writes the table anew with another column type, without a column, with empty cells, or in another way."""
    frame = pl.read_parquet(io.BytesIO(data))
    name = str(rng.choice(frame.columns))
    column = pl.col(name)
    types: list[type[pl.DataType]] = [pl.Float32, pl.String, pl.Int32, pl.Boolean, pl.Binary, pl.Date, pl.Null]
    how = int(rng.integers(12))
    changes: dict[int, Callable[[], pl.DataFrame]] = {
        0: lambda: frame.with_columns(pl.lit(None).cast(types[rng.integers(len(types))]).alias(name)),
        1: lambda: frame.drop(name),
        2: lambda: frame.rename({name: str(rng.choice(["t", "", "T_S", "x" * 300, "\n", "f_l_n "]))}),
        3: lambda: frame.with_columns(
            pl.when(pl.int_range(pl.len()) % 97 == 5).then(None).otherwise(column).alias(name)
        ),
        4: lambda: frame.with_columns(pl.concat_list(column).alias(name)),
        5: lambda: frame.with_columns(pl.struct(column).alias(name)),
        6: lambda: frame.sample(fraction=1, shuffle=True, seed=int(rng.integers(1 << 30))),
        7: lambda: frame.clear(),
        8: lambda: frame.with_columns(column.cast(pl.String).alias(name)),
        9: lambda: frame.with_columns(column.cast(pl.Categorical).alias(name)) if name == "grasp" else frame,
        10: lambda: frame.with_columns(pl.lit(float(rng.choice([np.nan, np.inf, -1e308, 0]))).alias(name)),
        11: lambda: pl.concat([frame, frame]),
    }
    buffer = io.BytesIO()
    pack = ("zstd", "gzip", "snappy", "lz4", "uncompressed")[rng.integers(5)]
    changes[how]().write_parquet(buffer, compression=pack, row_group_size=int(rng.choice([7, 100, 100_000])))
    return buffer.getvalue()


def spoil_footer(data: bytes, rng: Rng) -> bytes:
    """Changes bytes of a Parquet file where it says what it holds."""
    start = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
    at, length = int(rng.integers(start, len(data))), int(rng.integers(1, 5))
    return data[:at] + rng.bytes(length) + data[at + length :]


def spoil_yaml(data: bytes, rng: Rng) -> bytes:
    """Gives keys other values, or other names; repeats, drops or indents lines."""
    lines = data.decode().splitlines()
    for _ in range(int(rng.integers(1, 3))):
        at = int(rng.integers(len(lines)))
        key, colon, value = lines[at].partition(":")
        match int(rng.integers(6)):
            case 0 | 1:
                lines[at] = f"{key}: {_VALUES[rng.integers(len(_VALUES))]}"
            case 2:
                lines[at] = f"{_VALUES[rng.integers(len(_VALUES))]}{colon}{value}"
            case 3:
                lines.insert(int(rng.integers(len(lines))), lines[at])
            case 4:
                del lines[at]
                lines = lines or [""]
            case _:
                lines[at] = " " * int(rng.integers(1, 4)) + lines[at]
    return "\n".join(lines).encode("utf-8", "replace") + b"\n"
