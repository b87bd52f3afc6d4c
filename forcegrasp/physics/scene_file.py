"""Looks at a scene (MJCF) before MuJoCo does, which expands and allocates whatever a few lines ask for."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree

from forcegrasp.errors import ConfigError
from forcegrasp.files.bounded import read_bytes

MAX_BYTES = 1_000_000
MAX_ASSET_BYTES = 100_000_000
#: Copies, points and pixels that one element may ask for.
MAX_COPIES = 1_000
MAX_NUMBERS = 10_000_000
_MAX_INCLUDES = 20
_FOLDERS = ("assetdir", "meshdir", "texturedir")


def check_scene(path: Path) -> None:
    """Raises ConfigError if a scene is no XML, reads what is no ordinary file, or asks for too much."""
    _check(path, path.parent, [])


def _check(path: Path, folder: Path, above: list[Path]) -> None:
    if path in above or len(above) > _MAX_INCLUDES:
        raise ConfigError(f"{path}: includes itself; take that out")
    try:
        data = read_bytes(path, MAX_BYTES)
        if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
            raise ConfigError(f"{path}: entities are not supported; write them out")
        root = ElementTree.fromstring(data)
    except OSError as error:
        raise ConfigError(f"{path}: could not read the scene: {error.strerror}") from error
    except (ElementTree.ParseError, ValueError, LookupError, RecursionError) as error:
        raise ConfigError(f"{path}: not XML that can be read ({error})") from error
    folders = {folder} | {folder / e.get(name, "") for e in root.iter("compiler") for name in _FOLDERS}
    stack = [(root, 1)]
    while stack:
        element, copies = stack.pop()
        if element.tag == "replicate":
            copies *= _product(element.get("count", "1"))
        _check_size(path, element, copies)
        for name, value in element.attrib.items():
            if name.startswith("file") and element.tag != "include":
                _check_asset(path, {place / value for place in folders})
        if element.tag == "include":
            _check(folder / element.get("file", ""), folder, [*above, path])
        stack += [(child, copies) for child in element]


def _check_size(path: Path, element: ElementTree.Element, copies: float) -> None:
    grid = element.get("count", "1") if element.tag in ("flexcomp", "composite") else "1"
    if not copies * _product(grid) <= MAX_COPIES:
        raise ConfigError(f"{path}: {element.tag}: makes more than {MAX_COPIES:,} copies; make fewer")
    numbers = [
        _product(f"{element.get(a, '1')} {element.get(b, '1')}") for a, b in (("nrow", "ncol"), ("width", "height"))
    ]
    if element.tag == "size":
        numbers += [_product(value) for name, value in element.attrib.items() if name.startswith("n")]
    if not max(numbers) <= MAX_NUMBERS:
        raise ConfigError(f"{path}: {element.tag}: asks for more than {MAX_NUMBERS:,} numbers; make it smaller")


def _check_asset(path: Path, places: set[Path]) -> None:
    for place in places:
        if place.exists() and not place.is_dir() and not (place.is_file() and place.stat().st_size <= MAX_ASSET_BYTES):
            limit = f"{MAX_ASSET_BYTES // 1_000_000} MB"
            raise ConfigError(f"{path}: {place.name}: must be an ordinary file of at most {limit}")


def _product(text: str) -> float:
    """The product of the numbers in a text; infinite if it is something else."""
    try:
        return math.prod(abs(float(word)) for word in text.split())
    except ValueError:
        return math.inf
