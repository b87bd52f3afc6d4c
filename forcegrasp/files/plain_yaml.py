"""YAML as plain data: no tags, no anchors, nothing said twice, small and flat. Others may have made the file.

YAML's own safe loader builds no objects, but an anchor lets a few lines stand for gigabytes, and of a key that is there
twice it keeps the last.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml
from yaml.composer import Composer

from forcegrasp.files.bounded import read_bytes

#: What a fitted model of hundreds of objects needs, and what is read in seconds.
MAX_BYTES = 1_000_000
MAX_DEPTH = 20
#: Longest value.
MAX_VALUE = 20_000


class PlainYamlError(ValueError):
    """The file is no YAML, or says more than plain data; ``row`` counts lines from 1, and is 0 if not known."""

    def __init__(self, problem: str, row: int = 0) -> None:
        self.problem, self.row = " ".join(problem.split()), row
        super().__init__(f"row {row}: {self.problem}" if row else self.problem)


def load(path: Path, *, text_only: bool = False, max_bytes: int = MAX_BYTES) -> Any:
    """Returns what a YAML file holds.

    Args:
      path: the file.
      text_only: leave every scalar as it is written: `1e-5` is text to YAML anyway, `007` would be 7, and `no` False.
      max_bytes: the largest file that is read.

    Raises:
      OSError: if it can't be read, is no ordinary file, or too large.
      PlainYamlError: says why its content is refused.
    """
    data = read_bytes(path, max_bytes)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        row = data.count(b"\n", 0, error.start) + 1
        raise PlainYamlError("not UTF-8; save the file as UTF-8", row) from error
    try:
        return yaml.load(text, Loader=_Text) if text_only else yaml.load(text, Loader=_Typed)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        said = [getattr(error, name, None) for name in ("context", "problem", "reason")]
        problem = ", ".join(str(part) for part in said if part) or "not YAML that can be read"
        raise PlainYamlError(problem, mark.line + 1 if mark else 0) from error
    except PlainYamlError:
        raise
    except (ValueError, OverflowError, RecursionError) as error:  # such as a date in the 13th month
        raise PlainYamlError(str(error)) from error


def _compose_node(self: Any, parent: Any, index: Any) -> yaml.Node | None:
    event = self.peek_event()
    row = event.start_mark.line + 1
    if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
        raise PlainYamlError("anchors and aliases are not supported; write the value out", row)
    if getattr(event, "tag", None):
        raise PlainYamlError(f"the tag {event.tag[:60]!r} is not supported; leave it out", row)
    if len(getattr(event, "value", "")) > MAX_VALUE:  # YAML 1.1 reads 1:59:59: … as a number, and takes its time
        raise PlainYamlError(f"a value of {len(event.value)} characters; {MAX_VALUE} may be used", row)
    self.depth = getattr(self, "depth", 0) + 1
    if self.depth > MAX_DEPTH:
        raise PlainYamlError("nested too deeply; write it flat", row)
    node = Composer.compose_node(self, parent, index)
    self.depth -= 1
    return node


def _compose_mapping_node(self: Any, anchor: Any) -> yaml.MappingNode:
    node = Composer.compose_mapping_node(self, anchor)
    seen = set()
    for key, _ in node.value:
        row = key.start_mark.line + 1
        if not isinstance(key, yaml.ScalarNode):
            raise PlainYamlError("a key must be text", row)
        if key.value in seen:
            raise PlainYamlError(f"{key.value[:60]!r} stands there twice; keep one", row)
        seen.add(key.value)
    return node


class _Typed(yaml.SafeLoader):
    """YAML's numbers, dates and truth values."""

    compose_node = _compose_node
    compose_mapping_node = _compose_mapping_node


class _Text(yaml.BaseLoader):
    """Text alone."""

    compose_node = _compose_node
    compose_mapping_node = _compose_mapping_node
