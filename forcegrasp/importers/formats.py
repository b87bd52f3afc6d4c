"""The formats that are known by name, and how a source of any of them is read."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from forcegrasp.errors import ConfigError, MeasurementError, closest
from forcegrasp.importers import bam, dfki, emps, lerobot, mapped, pace, sage
from forcegrasp.importers.column_map import Map, read_map
from forcegrasp.importers.recording import OtherFileError, Recording, tidy
from forcegrasp.measure.check_commands import refuse_swapped

#: Format → its module, which has ``find``, ``read`` or ``read_all``, and the mechanism that it is of by default.
FORMATS: dict[str, Any] = {"sage": sage, "bam": bam, "emps": emps, "dfki": dfki, "pace": pace, "lerobot": lerobot}


def read_source(sources: Sequence[Path], format_name: str, map_file: str, joints: Sequence[str]) -> list[Recording]:
    """Reads files, or folders of recordings; in a folder, files of other kinds are left out, and noted.

    Args:
      sources: files or folders.
      format_name: one of :data:`FORMATS`, or empty with a map.
      map_file: a map of columns, see :mod:`forcegrasp.importers.mapped`; empty with a format.
      joints: which joints, in which order; all if empty.

    Rows without a number are left out, but a joint that nobody asked for may lack some.

    Raises:
      ConfigError: unless one of format and map is given.
      MeasurementError: file, row and what to do.
    """
    if bool(format_name) == bool(map_file):
        known = "|".join(FORMATS)
        raise ConfigError(f"import: give either format={known}, or map=FILE with the names of the columns")
    if format_name and format_name not in FORMATS:
        raise ConfigError(f"format={format_name}: no such format{closest(format_name, FORMATS)}")
    module = FORMATS[format_name] if format_name else mapped
    how = read_map(Path(map_file)) if map_file else None
    found: list[tuple[Path, Recording]] = []
    for source in sources:
        if not source.exists():
            raise MeasurementError(f"{source}: no such file or folder")
        places = module.find(source)
        if not places:
            raise MeasurementError(f"{source}: holds no recording{' of format ' + format_name if format_name else ''}")
        found += _read_places(module, places, how)
    for _, one in found:
        whole = np.isfinite(one.command).all(axis=1) & np.isfinite(one.position).all(axis=1)
        if not one.command_unit and whole.any():
            refuse_swapped(one.name, one.joints, one.command[whole], one.position[whole])
    return [tidy(one.of_joints(joints) if joints else one) for one in _with_own_names(found)]


def mechanism_of(format_name: str, recordings: Sequence[Recording]) -> str:
    """The mechanism that comes with the package for recordings of a format; empty if there is none.

    Raises:
      MeasurementError: if they are of several.
    """
    module = FORMATS[format_name]
    choose = getattr(module, "mechanism_of", lambda one: module.MECHANISM)
    found = {choose(one): one.name for one in recordings}
    if len(found) > 1:
        of_each = ", ".join(f"{recording} of {name}" for name, recording in found.items())
        raise MeasurementError(f"{of_each}: recordings of several mechanisms; import them apart, or give mechanism=")
    return next(iter(found))


def unlike(format_name: str, recordings: Sequence[Recording]) -> list[str]:
    """In what recordings may be unlike the mechanism that their format is of by default; a line each."""
    ask = getattr(FORMATS[format_name], "unlike", None)
    return list(dict.fromkeys(line for one in recordings if ask and (line := ask(one))))


def _read_places(module: Any, places: Sequence[Path], how: Map | None) -> list[tuple[Path, Recording]]:
    """The recordings of files; of several, such as are no recordings at all are left out."""
    found, others = [], []
    for place in places:
        try:
            found += [(place, one) for one in _recordings(module, place, how)]
        except OtherFileError as error:
            others.append(error)
    if not found:
        raise others[0]
    if others:
        names = ", ".join(str(error).partition(": ")[0].rpartition("/")[2] for error in others)
        first, one = found[0]
        found[0] = first, dataclasses.replace(one, notes=(f"left out, for it is no recording: {names}", *one.notes))
    return found


def _recordings(module: Any, place: Path, how: Map | None) -> Iterator[Recording]:
    if how is not None:
        yield from mapped.read_all(place, how)
    elif hasattr(module, "read_all"):
        yield from module.read_all(place)
    else:
        yield module.read(place)


def _with_own_names(found: Sequence[tuple[Path, Recording]]) -> list[Recording]:
    """The recordings; such as have the same name are told apart by their folders, as many as it takes."""
    names = [one.name for _, one in found]
    folders = [
        (place if place.is_dir() and place.name != one.name else place.parent).resolve().parts for place, one in found
    ]
    own = names
    for depth in range(1, 1 + max(map(len, folders), default=0)):
        if len(set(own)) == len(own):
            break
        own = [
            "_".join((*folder[-depth:], name)) if names.count(name) > 1 else name
            for folder, name in zip(folders, names, strict=True)
        ]
    return [dataclasses.replace(one, name=name) for (_, one), name in zip(found, own, strict=True)]
