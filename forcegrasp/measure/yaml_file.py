"""YAML as plain text, lists and mappings, and the types of what it says."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, ConfigDict

from forcegrasp.errors import MeasurementError
from forcegrasp.files import plain_yaml
from forcegrasp.files.validate import Record, must, text, wrong
from forcegrasp.measure.folder import MAX_NAME, show

MAX_TEXT = 10_000
_MAX_BYTES = 100_000
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)


def load_yaml(path: Path) -> dict[str, Any]:
    """Returns the mapping in a YAML file, with every scalar as text; a key without a value counts as left out.

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
    return _without_blanks(content)


def _without_blanks(content: Any) -> Any:
    if isinstance(content, list):
        return [_without_blanks(value) for value in content]
    if not isinstance(content, dict):
        return content
    there = {k: v for k, v in content.items() if not (isinstance(v, str) and v.strip() in ("", "~", "null"))}
    return {key: _without_blanks(value) for key, value in there.items()}


class TextRecord(Record):
    """A mapping whose scalars came as text."""

    model_config = ConfigDict(str_strip_whitespace=True)


def _number(value: object) -> float:
    if not isinstance(value, str) or not _NUMBER.fullmatch(value) or not math.isfinite(float(value)):
        raise wrong(f"{show(value)} is not a number; write it like 0.0123 or 1.2e-5")
    return float(value)


Number = Annotated[float, BeforeValidator(_number)]
Positive = Annotated[Number, must(lambda value: value > 0, "{:g} must be positive; leave it out if it is not known")]
Name = Annotated[str, text(MAX_NAME)]
Text = Annotated[str, text(MAX_TEXT, lines=True)]
