"""The two figures of a Parquet file that bound the memory it takes: rows, and bytes when unpacked.

Polars has no way to ask for the second. The footer is a Thrift struct in the compact protocol; of FileMetaData, field 3
is ``num_rows`` and field 4 the list of row groups, whose field 2 is ``total_byte_size`` (apache/parquet-format).
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from forcegrasp.errors import MeasurementError
from forcegrasp.measure.folder import show

_MAX_FOOTER = 2_000_000
_MAX_DEPTH = 20


@dataclass(frozen=True)
class Footer:
    """What a Parquet file says about itself."""

    rows: int
    bytes: int


def read_footer(path: Path) -> Footer:
    """Returns the size of what a Parquet file holds.

    Raises:
      MeasurementError: if the file is no Parquet file, or cut short.
    """
    broken = MeasurementError(f"{show(path)}: not a whole Parquet file; write it again, or give samples.csv")
    try:
        with open(path, "rb") as file:
            size = file.seek(0, os.SEEK_END)
            if size < 12:
                raise broken
            file.seek(size - 8)
            tail = file.read(8)
            length = int.from_bytes(tail[:4], "little")
            if tail[4:] != b"PAR1" or length > size - 12:
                raise broken
            if length > _MAX_FOOTER:
                raise MeasurementError(f"{show(path)}: a footer of {length / 1e6:.0f} MB; write fewer row groups")
            file.seek(size - 8 - length)
            meta = _Thrift(file.read(length)).struct()
    except OSError as error:
        raise MeasurementError(f"{show(path)}: not readable ({error.strerror})") from error
    except (IndexError, ValueError) as error:
        raise broken from error
    groups = meta.get(4, [])
    if not isinstance(meta.get(3), int) or not isinstance(groups, list):
        raise broken
    sizes = [group.get(2) if isinstance(group, dict) else None for group in groups]
    known = [size for size in sizes if isinstance(size, int) and size >= 0]
    if meta[3] < 0 or len(known) < len(sizes):
        raise broken
    return Footer(rows=meta[3], bytes=sum(known))


class _Thrift:
    """Reads structs of the compact protocol into ``{field: value}``. Raises IndexError or ValueError on nonsense."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at, self._depth = data, 0, 0

    def struct(self) -> dict[int, Any]:
        self._depth += 1
        if self._depth > _MAX_DEPTH:
            raise ValueError("nested too deeply")
        fields: dict[int, Any] = {}
        field = 0
        while head := self._byte():
            delta, kind = head >> 4, head & 15
            field = field + delta if delta else self._zigzag()
            fields[field] = (kind == 1) if kind in (1, 2) else self._value(kind)
        self._depth -= 1
        return fields

    def _value(self, kind: int) -> Any:
        if kind in (1, 2, 3):
            return self._byte()
        if kind in (4, 5, 6):
            return self._zigzag()
        if kind == 7:
            return self._skip(8)
        if kind == 8:
            return self._skip(self._varint())
        if kind in (9, 10):
            head = self._byte()
            count = head >> 4 if head >> 4 < 15 else self._varint()
            if count > len(self._data) - self._at:  # an item takes a byte at least
                raise ValueError("list longer than the footer")
            return [self._value(head & 15) for _ in range(count)]
        if kind == 12:
            return self.struct()
        raise ValueError(f"unknown type {kind}")

    def _byte(self) -> int:
        self._at += 1
        return self._data[self._at - 1]

    def _skip(self, count: int) -> None:
        if count > len(self._data) - self._at:
            raise ValueError("text longer than the footer")
        self._at += count

    def _varint(self) -> int:
        value = shift = 0
        while True:
            byte = self._byte()
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value
            if shift > 63:
                raise ValueError("number too long")

    def _zigzag(self) -> int:
        value = self._varint()
        return (value >> 1) ^ -(value & 1)
