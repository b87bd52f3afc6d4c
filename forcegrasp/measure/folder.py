"""The files of a measurement set, none of which may lie elsewhere or be too large to read."""

from __future__ import annotations

import difflib
import shlex
import stat
from pathlib import Path
from typing import TYPE_CHECKING

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.errors import ConfigError, MeasurementError
from forcegrasp.files.validate import refusal
from forcegrasp.measure.schema import FORMAT

if TYPE_CHECKING:
    from forcegrasp.physics.gripper import Gripper

MAX_BYTES = 2_000_000_000
MAX_ROWS = 20_000_000
#: Longest name of a grasp, object or session.
MAX_NAME = 100


def show(value: object, length: int = 60) -> str:
    """A value as it may stand in a message: on one line, and not too long."""
    text = str(value) if isinstance(value, Path) else repr(value)
    text = text if text.isprintable() else repr(text)
    return text if len(text) <= length or isinstance(value, Path) else f"{text[: length - 1]}…"


def open_folder(path: str | Path) -> Path:
    """Returns the folder of a measurement set.

    Raises:
      MeasurementError: if there is none.
    """
    folder = Path(path)
    try:
        mode = folder.stat().st_mode
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a path"
        raise MeasurementError(f"{show(folder)}: no such measurement set ({reason}); give its folder") from error
    if not stat.S_ISDIR(mode):
        raise MeasurementError(f"{show(folder)}: not a folder; give the folder that holds meta.yaml")
    return folder


def _starter(path: Path) -> str:
    """The command that writes a meta.yaml to begin with; "" for any other file."""
    if path.name != "meta.yaml":
        return ""
    kind = "final_force" if (path.parent / "table.csv").exists() else "grasps"
    text = f"format: {FORMAT}\\nkind: {kind}\\ngripper: {DEFAULT_GRIPPER}\\n"
    return f"; write it, with your gripper: printf '{text}' > {shlex.quote(show(path))}"


def find_file(folder: Path, name: str) -> Path:
    """Returns the path of one file of the set.

    Raises:
      MeasurementError: if it is missing, no ordinary file, lies outside the folder, or is too large.
    """
    path = folder / name
    try:
        if not path.is_symlink() and not path.exists():
            near = difflib.get_close_matches(name, [entry.name for entry in folder.iterdir()], n=1, cutoff=0.6)
            hint = f"; rename {show(near[0])} to {name}, unpacked if it is packed" if near else _starter(path)
            raise MeasurementError(f"{show(path)}: missing{hint}")
        if not path.resolve(strict=True).is_relative_to(folder.resolve()):
            raise MeasurementError(f"{show(path)}: links to a file outside the folder; copy that file here")
        facts = path.stat()
    except (OSError, RuntimeError) as error:
        raise MeasurementError(
            f"{show(path)}: not readable ({getattr(error, 'strerror', None) or error}); replace the file"
        ) from error
    if not stat.S_ISREG(facts.st_mode):
        raise MeasurementError(f"{show(path)}: not an ordinary file; replace it by one")
    if facts.st_size > MAX_BYTES:
        raise MeasurementError(
            f"{show(path)}: {facts.st_size / 1e9:.1f} GB is too large; split it into sets under 2 GB"
        )
    return path


def described(name: str, folder: Path, place: str, key: str) -> Gripper:
    """The gripper or mechanism of this name; ``folder`` is where the path of its description starts.

    Raises:
      MeasurementError: if there is none, or its description can't be right; names the file and the key that say it.
    """
    from forcegrasp.physics.gripper_file import load_gripper  # brings MuJoCo, which nothing else here needs

    try:
        return load_gripper(name, folder)
    except ConfigError as error:
        raise refusal(place, key, str(error).removeprefix("gripper="), MeasurementError) from error
