"""Datasets of LeRobot (github.com/huggingface/lerobot), v2 and v3: Parquet files of actions and states."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from forcegrasp.errors import MeasurementError
from forcegrasp.files.bounded import read_bytes
from forcegrasp.importers.encoder import COUNTS, radians_per_unit
from forcegrasp.importers.recording import OtherFileError, Recording, files_below, is_jaw, unlike_a_jaw
from forcegrasp.importers.tables import read_parquet

MECHANISM, unlike = "so101_jaw", unlike_a_jaw
_MAX_BYTES = 50_000_000
_NEEDED = ("action", "observation.state", "timestamp", "episode_index")
#: Larger positions are no radians.
_SPAN_RAD = 7.0
#: Beginnings of the names of robots whose servos have encoders of 4096 counts.
_COUNTING = ("so100", "so101", "so_", "bi_so", "koch", "lekiwi", "moss", "omx")
#: A unit of theirs is at most a per cent of a turn, rounding up; steps that say otherwise are no counts.
_MOST_RAD = 2 * np.pi / 98
_MAP = "say which column is what with map="


def find(source: Path) -> list[Path]:
    """Datasets at or below a folder, or the file itself."""
    if source.is_file():
        return [source]
    return list(dict.fromkeys(_dataset(file) or file for file in _frames(source)))


def read_all(place: Path) -> Iterator[Recording]:
    """The episodes of a dataset, or of a file of it, one recording each.

    Raises:
      MeasurementError: if a column is missing, all are named; or if actions and states are not of the same joints.
    """
    files = _frames(place) if place.is_dir() else [place]
    dataset = _dataset(files[0])
    info = _info(dataset) if dataset else {}
    frames = [_columns(file) for file in files]
    try:
        command, position, time_s, episode = (np.concatenate([one[name] for one in frames]) for name in _NEEDED)
    except ValueError as error:
        raise MeasurementError(f"{place}: its files are of different widths; import them one by one") from error
    joints, acting, reading, notes = _joints(place, info, command.shape[1], position.shape[1])
    command, position = command[:, acting], position[:, reading]
    scale, units = _units(joints, position, str(info.get("robot_type")).lower())
    for index in dict.fromkeys(episode[np.isfinite(episode)].tolist()):
        rows = episode == index
        yield Recording(
            f"episode_{int(index):06d}", joints, time_s[rows], command[rows] * scale, position[rows] * scale,
            notes=(*notes, *units),
        )  # fmt: skip


def _frames(folder: Path) -> list[Path]:
    found = {file: file.relative_to(folder).parts for file in files_below(folder, "*.parquet")}
    return [f for f in found if "data" in found[f]] or [f for f in found if "meta" not in found[f]]


def _dataset(file: Path) -> Path | None:
    """The folder of the dataset that a file of frames is in."""
    return next((folder for folder in file.parents[:4] if (folder / "meta" / "info.json").is_file()), None)


def _info(dataset: Path) -> dict[str, Any]:
    try:
        found = json.loads(read_bytes(dataset / "meta" / "info.json", _MAX_BYTES))
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _columns(file: Path) -> dict[str, np.ndarray]:
    """What is needed of a file: time and episode ``(T,)``, actions and states ``(T, J)``."""
    table = read_parquet(file, _NEEDED)
    if missing := [name for name in _NEEDED if name not in table.columns]:
        kind = OtherFileError if len(missing) == len(_NEEDED) else MeasurementError
        raise kind(f"{file}: no column {', '.join(missing)}; it has {', '.join(pl.read_parquet_schema(file))}; {_MAP}")
    try:
        found = {name: np.array(table[name].to_list(), float) for name in _NEEDED}
    except (TypeError, ValueError) as error:
        raise MeasurementError(f"{file}: {', '.join(_NEEDED)} must be numbers, as many in each row") from error
    # a feature of one number is a plain column
    return {name: values.reshape(len(values), -1) if name in _NEEDED[:2] else values for name, values in found.items()}


def _joints(place: Path, info: dict[str, Any], acts: int, states: int) -> tuple[Any, ...]:
    """Names of the joints, their places in an action and in a state, and notes."""
    action, state = _names(info, "action"), _names(info, "observation.state")
    if len(action) == acts and len(state) == states:
        both = [name for name in state if name in action and not name.endswith(".vel")]
        if not both:
            raise MeasurementError(
                f"{place}: an action is {', '.join(action)}, and a state {', '.join(state)}: none is in both; {_MAP}"
            )
        others = [name for name in dict.fromkeys((*state, *action)) if name not in both]
        notes = (f"skipped, for they are no positions in action and state: {', '.join(others)}",) if others else ()
        return tuple(both), [action.index(name) for name in both], [state.index(name) for name in both], notes
    if acts != states:
        raise MeasurementError(f"{place}: an action has {acts} numbers, and a state {states}, without names; {_MAP}")
    names = next((names for names in (action, state) if len(names) == acts), ())
    note = () if names else (f"the joints have no names in it: they are called joint_0 to joint_{acts - 1}",)
    return names or tuple(f"joint_{i}" for i in range(acts)), range(acts), range(acts), note


def _names(info: dict[str, Any], feature: str) -> tuple[str, ...]:
    """Names of a feature's numbers; empty if there are none, or some are there twice."""
    try:
        given = info.get("features", {}).get(feature, {}).get("names") or info.get("names", {}).get(feature)
    except AttributeError:
        return ()
    found = tuple(name.removesuffix(".pos") for name in _flat(given))
    return found if len(set(found)) == len(found) else ()


def _flat(names: Any) -> list[str]:
    """Names of a list, of lists in a list or under a word such as ``motors``, or with their numbers."""
    if isinstance(names, dict):
        numbered = all(isinstance(number, int) for number in names.values())
        return sorted(names, key=names.__getitem__) if numbered else _flat(list(names.values()))
    if isinstance(names, list):
        return [name for part in names for name in _flat(part)]
    return [names] if isinstance(names, str) else []


def _units(joints: tuple[str, ...], position: np.ndarray, robot: str) -> tuple[np.ndarray, tuple[str, ...]]:
    """Radians of one unit of each joint, and what was guessed.

    Units are radians, degrees, or -100..100 and 0..100 of a joint's range: the counts of its encoder tell the last two.
    """
    size = np.nanmax(np.abs(position), axis=0, initial=0)
    arm = [i for i, joint in enumerate(joints) if not is_jaw(joint)]
    radians = {i for i in range(len(joints)) if size[i] <= _SPAN_RAD and (i not in arm or size[arm].max() <= _SPAN_RAD)}
    scale, counted, guessed = np.ones(len(joints)), [], []
    for i in sorted(set(range(len(joints))) - radians):
        degree, count = np.pi / 180, radians_per_unit(position[:, i])
        if count and count < _MOST_RAD and (robot.startswith(_COUNTING) or abs(count / degree - 1) < 0.01):
            scale[i] = count
            counted.append(f"{joints[i]} {np.rad2deg(count):.4g}°")
        else:
            scale[i] = degree
            guessed.append(joints[i])
    which = "positions" if len(radians) == len(joints) else ", ".join(joints[i] for i in sorted(radians))
    notes = [f"{which} are taken as radians"] if radians else []
    notes += [f"one unit, by counts of 1/{COUNTS} of a turn: {', '.join(counted)}"] if counted else []
    notes += [f"taken as degrees: {', '.join(guessed)}; if they are shares of a range, {_MAP}"] if guessed else []
    return scale, tuple(notes)
