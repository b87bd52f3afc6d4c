"""What a YAML file must hold, as pydantic models; and what is wrong with one, in a line that names file and key."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticCustomError

from forcegrasp.errors import ConfigError, ForcegraspError, closest

# So many problems of a file are told at once; longest key and value in a message.
_MOST, _LONGEST_KEY, _LONGEST_VALUE = 5, 80, 40
_NUMBER, _TEXT = "must be a number", "must be text"
_EXPONENT = re.compile(r"[-+.\d]+[eE][-+]?\d+")
_PROBLEMS = {
    "float_type": _NUMBER,
    "finite_number": _NUMBER,
    "string_type": _TEXT,
    "dict_type": "must be a mapping",
    "list_type": "must be a list",
    "greater_than": "must be positive",
}


class Record(BaseModel):
    """A mapping of known keys. Nothing is converted: "3" is no number, true is not 1, NaN and infinity are refused."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


AnyRecord = TypeVar("AnyRecord", bound=Record)


def validate(
    kind: type[AnyRecord], raw: object, place: object, error: type[ForcegraspError] = ConfigError
) -> AnyRecord:
    """Returns what a file holds.

    Args:
      kind: what it must hold.
      raw: as it came from YAML.
      place: the file, as messages call it.
      error: what to raise.

    Raises:
      ForcegraspError: says what is wrong with up to five keys, unknown ones first.
    """
    try:
        return kind.model_validate(_with_text_keys(raw))
    except ValidationError as refused:
        found = sorted(refused.errors(include_url=False), key=lambda problem: problem["type"] != "extra_forbidden")
        told = list(dict.fromkeys(_tell(kind, problem) for problem in found))
        more = [f"{len(told) - _MOST} more"] if len(told) > _MOST else []
        raise refusal(place, "", "; also ".join(told[:_MOST] + more), error) from refused


def refusal(place: object, key: str, problem: str, error: type[ForcegraspError] = ConfigError) -> ForcegraspError:
    """The error to raise about a key, in one printable line whatever the file says."""
    text = ": ".join(filter(None, (str(place), _cut(key, _LONGEST_KEY), problem)))
    return error(" ".join("".join(c if c.isprintable() else " " for c in text).split()))


def wrong(problem: str, *at: str) -> PydanticCustomError:
    """What a validator raises; ``at`` are keys below the one that it validates."""
    return PydanticCustomError("wrong", "{problem}", {"problem": problem, "at": at})


def text(longest: int, lines: bool = False) -> AfterValidator:
    """Makes a validator of printable text, not blank and not too long; of several lines if ``lines``."""

    def check(value: str) -> str:
        if len(value) > longest:
            raise wrong(f"{len(value)} characters are too many; {longest} may be used")
        if not value.strip():
            raise wrong("must be text and not empty")
        if not (value.replace("\n", "") if lines else value).isprintable():
            raise wrong(f"{_cut(repr(value), _LONGEST_VALUE)} holds characters that can't be printed; remove them")
        return value

    return AfterValidator(check)


def must(holds: Callable[[Any], bool], problem: str) -> AfterValidator:
    """Makes a validator of what must hold; braces in ``problem`` are the value."""

    def check(value: Any) -> Any:
        if not holds(value):
            raise wrong(problem.format(value))
        return value

    return AfterValidator(check)


def counted(least: int, most: int, what: str) -> BeforeValidator:
    """Makes a validator of tuples of so many items, which are lists in YAML."""

    def check(value: object) -> tuple[object, ...]:
        if not isinstance(value, list) or not least <= len(value) <= most:
            raise wrong(f"must be {what}")
        return tuple(value)

    return BeforeValidator(check)


def _tell(root: type[Record], problem: ErrorDetails) -> str:
    """One problem with its key: what it must be, what it is, and what to do."""
    kind, context, value = problem["type"], problem.get("ctx", {}), problem["input"]
    loc = (*problem["loc"], *context.get("at", ()))
    where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in loc).lstrip(".") or "the file"
    where = _cut(where, _LONGEST_KEY)
    if kind == "extra_forbidden":
        keys = {key for record in _find(root, loc[:-1])[0] for key in record.model_fields}
        return f"{where}: unknown{closest(str(loc[-1]), keys)}"
    records, field = _find(root, loc)
    example = f", such as `{field.examples[0]}`" if field and field.examples else ""
    if kind == "missing":
        return f"{where}: missing{example}"
    if kind == "model_type":
        keys = [key for r in records if r.model_config.get("extra") == "forbid" for key in r.model_fields]
        return f"{where}: must map {', '.join(keys)}" if keys else f"{where}: must be a mapping"
    if kind == "literal_error":
        return f"{where}: must be {context['expected'].replace(chr(39), '')}, not {_shown(value)}"
    if kind not in _PROBLEMS:
        return f"{where}: {problem['msg']}"
    said = _PROBLEMS[kind]
    shown = f", not {_shown(value)}" if said in (_NUMBER, _TEXT) else ""
    hint = "; put it in quotes" if said == _TEXT else ""
    if said == _NUMBER and isinstance(value, str) and _EXPONENT.fullmatch(value):
        hint = "; YAML wants 1.0e-3 for 1e-3"
    return f"{where}: {said}{shown}{example}{hint}"


def _find(root: type[Record], loc: tuple[int | str, ...]) -> tuple[list[type[Record]], FieldInfo | None]:
    """What may be at a place in a file: records, and the field that says so."""
    records, field = [root], None
    for part in loc:
        found = next((record.model_fields[str(part)] for record in records if part in record.model_fields), None)
        if found:
            records, field = list(_records_in(found.annotation)) or records, found
    return records, field


def _records_in(annotation: Any) -> Iterator[type[Record]]:
    if isinstance(annotation, type) and issubclass(annotation, Record):
        yield annotation
    for part in get_args(annotation):
        yield from _records_in(part)


def _with_text_keys(raw: object) -> object:
    """As YAML has it, but with 7 and null as the names they are meant to be."""
    if isinstance(raw, dict):
        return {str(key): _with_text_keys(value) for key, value in raw.items()}
    return [_with_text_keys(value) for value in raw] if isinstance(raw, list) else raw


def _shown(value: object) -> str:
    return _cut(" ".join(str(value).split()), _LONGEST_VALUE)


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else f"{text[:longest]}…"
