"""Tensors out of a ``.pt`` file, without unpickling: its opcodes are read, and what is no plain data is refused."""

from __future__ import annotations

import io
import math
import pickletools
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from forcegrasp.files.bounded import read_bytes

_MAX_BYTES = 1_000_000_000
#: Kinds of storage that are numbers, by their class in the file.
_KINDS = {
    "torch FloatStorage": "<f4", "torch DoubleStorage": "<f8", "torch HalfStorage": "<f2", "torch LongStorage": "<i8",
    "torch IntStorage": "<i4", "torch ShortStorage": "<i2", "torch BoolStorage": "?", "torch ByteStorage": "u1",
}  # fmt: skip
_TENSOR, _ORDERED = "torch._utils _rebuild_tensor_v2", "collections OrderedDict"
_MARK = object()
_DATA = {"NONE": None, "NEWTRUE": True, "NEWFALSE": False}
_GIVEN = {
    "BINUNICODE",
    "SHORT_BINUNICODE",
    "BINUNICODE8",
    "BININT",
    "BININT1",
    "BININT2",
    "LONG1",
    "BINFLOAT",
    "GLOBAL",
}


def read_tensors(path: Path) -> dict[Any, Any]:
    """The mapping that ``torch.save`` wrote: tensors as arrays, beside plain data.

    Raises:
      OSError: if it can't be read.
      ValueError: if it is no such file, or holds anything else.
    """
    try:
        archive = zipfile.ZipFile(io.BytesIO(read_bytes(path, _MAX_BYTES)))
        top = next(name for name in archive.namelist() if name.endswith("/data.pkl")).removesuffix("data.pkl")
        if sum(entry.file_size for entry in archive.infolist()) > _MAX_BYTES:
            raise ValueError("too large")
        content = _Reader(archive, top).read()
    except (zipfile.BadZipFile, StopIteration, KeyError, IndexError, TypeError, AttributeError) as error:
        raise ValueError("no file of tensors") from error
    if not isinstance(content, dict):
        raise ValueError("no mapping")
    return content


class _Reader:
    """Follows the opcodes of one mapping; ``collections.OrderedDict`` and tensors are all that may be made."""

    def __init__(self, archive: zipfile.ZipFile, top: str) -> None:
        self._archive, self._top = archive, top
        self._stack: list[Any] = []
        self._memo: dict[int, Any] = {}

    def read(self) -> Any:
        for opcode, argument, _ in pickletools.genops(self._archive.read(f"{self._top}data.pkl")):
            name = opcode.name
            if name == "STOP":
                return self._stack.pop()
            if name in _GIVEN:
                self._stack.append(argument)
            elif name in _DATA:
                self._stack.append(_DATA[name])
            else:
                self._step(name, argument)
        raise ValueError("it ends too early")

    def _step(self, name: str, argument: Any) -> None:
        stack = self._stack
        match name:
            case "PROTO" | "FRAME":
                pass
            case "MARK":
                stack.append(_MARK)
            case "EMPTY_DICT":
                stack.append({})
            case "EMPTY_LIST":
                stack.append([])
            case "EMPTY_TUPLE":
                stack.append(())
            case "TUPLE":
                stack.append(tuple(self._since_mark()))
            case "TUPLE1" | "TUPLE2" | "TUPLE3":
                count = int(name[-1])
                stack[-count:] = [tuple(stack[-count:])]
            case "BINPUT" | "LONG_BINPUT":
                self._memo[argument] = stack[-1]
            case "MEMOIZE":
                self._memo[len(self._memo)] = stack[-1]
            case "BINGET" | "LONG_BINGET":
                stack.append(self._memo[argument])
            case "APPENDS":
                items = self._since_mark()
                stack[-1].extend(items)
            case "APPEND":
                item = stack.pop()
                stack[-1].append(item)
            case "SETITEMS":
                items = self._since_mark()
                stack[-1].update(zip(items[::2], items[1::2], strict=True))
            case "SETITEM":
                value, key = stack.pop(), stack.pop()
                stack[-1][key] = value
            case "STACK_GLOBAL":
                second, first = stack.pop(), stack.pop()
                stack.append(f"{first} {second}")
            case "BINPERSID":
                stack.append(self._storage(stack.pop()))
            case "REDUCE":
                arguments, made = stack.pop(), stack.pop()
                stack.append(_made(made, arguments))
            case _:
                raise ValueError(f"holds {name}")

    def _since_mark(self) -> list[Any]:
        place = max(i for i, item in enumerate(self._stack) if item is _MARK)
        items = self._stack[place + 1 :]
        del self._stack[place:]
        return items

    def _storage(self, said: tuple[Any, ...]) -> np.ndarray:
        word, kind, key = said[:3]
        if word != "storage" or kind not in _KINDS or not str(key).isdigit():
            raise ValueError("holds a storage of another kind")
        return np.frombuffer(self._archive.read(f"{self._top}data/{key}"), _KINDS[kind])


def _made(what: Any, arguments: tuple[Any, ...]) -> Any:
    if what == _ORDERED and not arguments:
        return {}
    if what != _TENSOR:
        raise ValueError(f"holds {what}")
    storage, offset, size, stride = arguments[:4]
    if not isinstance(storage, np.ndarray) or offset + math.prod(size) > len(storage) or any(s < 0 for s in stride):
        raise ValueError("holds a tensor that is larger than its numbers")
    last = offset + sum((n - 1) * s for n, s in zip(size, stride, strict=True))
    if math.prod(size) and last >= len(storage):
        raise ValueError("holds a tensor that is larger than its numbers")
    steps = [s * storage.itemsize for s in stride]
    return np.lib.stride_tricks.as_strided(storage[offset:], size, steps, writeable=False).copy()
