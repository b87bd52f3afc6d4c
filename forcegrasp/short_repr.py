"""What an object says of itself at a prompt: one line, however much it holds."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from typing import Any

#: Most characters of a repr.
LONGEST = 300
_LONGEST_TEXT = 40


class ShortRepr:
    """Base of dataclasses that hold arrays or much text; they are declared with ``repr=False``.

    A class says in :meth:`summary` what a user wants to know; by default that is every field, arrays by their shapes.
    """

    def summary(self) -> str:
        """What stands between the parentheses of the repr."""
        assert is_dataclass(self)
        return ", ".join(f"{field.name}={_brief(getattr(self, field.name))}" for field in fields(self))

    def __repr__(self) -> str:
        return cut(f"{type(self).__name__}({self.summary()})", LONGEST)


def cut(text: str, most: int = _LONGEST_TEXT) -> str:
    """A text on one line, and not too long."""
    text = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return text if len(text) <= most else f"{text[: most - 1]}…"


def some(names: Iterable[str], most: int = 3) -> str:
    """The first of some names, and how many more there are."""
    names = [cut(name) for name in names]
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def counted(number: int, noun: str) -> str:
    """A number with its noun: ``1 grasp``, ``2 grasps``."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def as_sentence(text: str) -> str:
    """A text with a capital and a full stop."""
    return f"{text[:1].upper()}{text[1:]}."


def _brief(value: Any) -> str:
    shape = getattr(value, "shape", ())
    if shape:
        return f"array{tuple(shape)}"
    if isinstance(value, (dict, list, tuple, set, frozenset)) and len(value) > 3:
        return f"{type(value).__name__} of {len(value)}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_brief, value))}]"
    if isinstance(value, float):
        return f"{value:.4g}"
    return cut(value.__name__ if isinstance(value, type) else repr(value), 2 * _LONGEST_TEXT)
