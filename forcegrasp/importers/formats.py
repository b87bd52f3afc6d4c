"""The formats that are known by name, and how a source of any of them is read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from forcegrasp.errors import ConfigError, MeasurementError, closest
from forcegrasp.importers import bam, dfki, emps, lerobot, mapped, pace, sage
from forcegrasp.importers.recording import Recording, steady_rate

#: Format → its module, which has ``find``, ``read`` or ``read_all``, and the mechanism that it is of by default.
FORMATS: dict[str, Any] = {"sage": sage, "bam": bam, "emps": emps, "dfki": dfki, "pace": pace, "lerobot": lerobot}


def read_source(sources: Sequence[Path], format_name: str, map_file: str, joints: Sequence[str]) -> list[Recording]:
    """Reads files, or folders of recordings.

    Args:
      sources: files or folders.
      format_name: one of :data:`FORMATS`, or empty with a map.
      map_file: a map of columns, see :mod:`forcegrasp.importers.mapped`; empty with a format.
      joints: which joints, in which order; all if empty.

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
    how = mapped.Map(Path(map_file)) if map_file else None
    found: list[Recording] = []
    for source in sources:
        if not source.exists():
            raise MeasurementError(f"{source}: no such file or folder")
        places = module.find(source)
        if not places:
            raise MeasurementError(f"{source}: holds no recording{' of format ' + format_name if format_name else ''}")
        for place in places:
            found += _recordings(module, place, how)
    for one in found:
        steady_rate(one.name, one.time_s)
    return [one.of_joints(joints) for one in found] if joints else found


def _recordings(module: Any, place: Path, how: mapped.Map | None) -> Iterator[Recording]:
    if how is not None:
        yield from mapped.read_all(place, how)
    elif hasattr(module, "read_all"):
        yield from module.read_all(place)
    else:
        yield module.read(place)
