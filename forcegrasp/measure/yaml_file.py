"""YAML as plain text, lists and mappings, and typed values out of it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from forcegrasp.errors import MeasurementError
from forcegrasp.files import plain_yaml
from forcegrasp.measure.folder import show
from forcegrasp.measure.names import misfits

_MAX_BYTES = 100_000
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)


def load_yaml(path: Path) -> dict[str, Any]:
    """Returns the mapping in a YAML file, with every scalar as text.

    Raises:
      MeasurementError: if the file is too large, not UTF-8, no YAML, no mapping, or uses tags, anchors or aliases.
    """
    try:
        content = plain_yaml.load(path, text_only=True, max_bytes=_MAX_BYTES)
    except OSError as error:
        raise MeasurementError(f"{show(path)}: not readable ({error.strerror})") from error
    except plain_yaml.PlainYamlError as error:
        row = f" row {error.row}:" if error.row else ""
        raise MeasurementError(f"{show(path)}:{row} not YAML that can be read: {error.problem}") from error
    if not isinstance(content, dict):
        raise MeasurementError(f"{show(path)}: must hold lines of the form `key: value`")
    return content


class Reader:
    """Takes typed values out of a mapping that came from :func:`load_yaml`, and says where it stood."""

    def __init__(self, content: Any, place: str, required: Iterable[str], optional: Iterable[str] = ()) -> None:
        required, optional = tuple(required), tuple(optional)
        self._content, self._place = content, place
        if not isinstance(content, dict):
            raise MeasurementError(f"{place}: must hold {', '.join(required)}, each as `key: value`")
        problem = misfits("key", list(content), required, optional)
        if problem:
            raise MeasurementError(f"{place}: {problem}")

    def refuse(self, key: str, problem: str) -> MeasurementError:
        """The error to raise about one key."""
        return MeasurementError(f"{self._place}: {key}: {problem}")

    def get(self, key: str) -> Any:
        """The value as it came; None if there is none."""
        return self._content.get(key)

    def text(self, key: str, longest: int, lines: bool = False, blank: bool = False) -> str:
        """Printable text; of several lines if ``lines``, and "" where there is none if ``blank``."""
        value = self._content.get(key, "")
        if blank and isinstance(value, str) and value.strip() in ("", "~", "null"):
            return ""
        if not isinstance(value, str) or value.strip() in ("", "~", "null"):
            raise self.refuse(key, "must be text and not empty")
        value = value.strip()
        if len(value) > longest:
            raise self.refuse(key, f"{len(value)} characters are too many; {longest} may be used")
        if not (value.replace("\n", "") if lines else value).isprintable():
            raise self.refuse(key, f"{show(value)} holds characters that can't be printed; remove them")
        return value

    def number(self, key: str, default: float | None = None) -> float | None:
        """A finite number, or the default if the key is absent or empty."""
        value = self._content.get(key, "")
        if isinstance(value, str) and value.strip() in ("", "~", "null"):
            return default
        if not isinstance(value, str) or not _NUMBER.fullmatch(value) or not math.isfinite(float(value)):
            raise self.refuse(key, f"{show(value)} is not a number; write it like 0.0123 or 1.2e-5")
        return float(value)

    def positive(self, key: str) -> float | None:
        """A positive number, or None."""
        value = self.number(key)
        if value is not None and value <= 0:
            raise self.refuse(key, f"{value:g} must be positive; leave it out if it is not known")
        return value
