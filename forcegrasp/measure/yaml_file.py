"""YAML as plain text, lists and mappings: nothing is guessed, nothing is built, nothing can blow up."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import yaml

from forcegrasp.errors import MeasurementError, closest
from forcegrasp.measure.folder import show

_MAX_BYTES = 100_000
_MAX_DEPTH = 20
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)


class _RefusedError(Exception):
    """Legal YAML that is not welcome here."""

    def __init__(self, mark: yaml.Mark, problem: str) -> None:
        self.problem_mark, self.problem = mark, problem


class _Loader(yaml.BaseLoader):
    """Every scalar stays text: `1e-5` is text to YAML anyway, `007` would be 7, and `no` would be False."""

    _depth = 0

    def compose_node(self, parent, index):
        event = self.peek_event()
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            raise _RefusedError(event.start_mark, "anchors and aliases are not supported; write the value out")
        if getattr(event, "tag", None):
            raise _RefusedError(event.start_mark, f"the tag {show(event.tag)} is not supported; leave it out")
        if self._depth == _MAX_DEPTH:
            raise _RefusedError(event.start_mark, "nested too deeply; write it flat")
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_mapping(self, node, deep=False):
        seen = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise _RefusedError(key.start_mark, "a key must be text")
            if key.value in seen:
                raise _RefusedError(key.start_mark, f"{show(key.value)} stands there twice; keep one")
            seen.add(key.value)
        return super().construct_mapping(node, deep)


def load_yaml(path: Path) -> dict[str, Any]:
    """Returns the mapping in a YAML file, with every scalar as text.

    Raises:
      MeasurementError: if the file is too large, not UTF-8, no YAML, no mapping, or uses tags, anchors or aliases.
    """
    try:
        with open(path, "rb") as file:
            data = file.read(_MAX_BYTES + 1)
        if len(data) > _MAX_BYTES:
            raise MeasurementError(
                f"{show(path)}: larger than {_MAX_BYTES // 1000} kB; keep it to the few lines it needs"
            )
        content = yaml.load(data.decode("utf-8-sig"), Loader=_Loader)
    except OSError as error:
        raise MeasurementError(f"{show(path)}: not readable ({error.strerror})") from error
    except UnicodeDecodeError as error:
        row = error.object.count(b"\n", 0, error.start) + 1
        raise MeasurementError(f"{show(path)}: row {row}: not UTF-8; save the file as UTF-8") from error
    except (_RefusedError, yaml.YAMLError, ValueError) as error:
        mark = getattr(error, "problem_mark", None)
        row = f" row {mark.line + 1}:" if mark else ""
        problem = getattr(error, "problem", None) or getattr(error, "reason", None) or "broken"
        problem = " ".join(str(problem).split())
        raise MeasurementError(f"{show(path)}:{row} not YAML that can be read: {problem}") from error
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
        for key in content:
            if key not in required + optional:
                raise MeasurementError(f"{place}: unknown key {show(key)}{closest(key, required + optional)}")
        for key in required:
            if key not in content:
                raise MeasurementError(f"{place}: {key} is missing; add it")

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
