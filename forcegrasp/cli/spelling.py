"""Other ways to type an option: by its position, under its other name, or one value where a list is wanted."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from forcegrasp.cli.verb import Verb
from forcegrasp.errors import ConfigError

#: How else an option may be called, where a verb has it under the second name only.
OTHER_NAMES = {"policy": "policies", "effect": "effects", "effects": "effect"}


def spell_out(
    verb: Verb, arguments: list[str], options: Mapping[str, Any], parse: Callable[[str], Any], sweep: bool = False
) -> list[str]:
    """Returns the arguments as ``key=value``, with lists in brackets.

    Args:
      verb: that they are typed after.
      arguments: as typed.
      options: the verb's, with their defaults.
      parse: Hydra's reading of one ``key=value``; raises ConfigError where it can't be read.
      sweep: whether an option may have several values, separated by commas.

    Raises:
      ConfigError: if one thing is given twice.
    """
    key, word = verb.positional
    positional = [a for a in arguments if key and _is_positional(a)]
    named = [_rename(a, options) for a in arguments if a not in positional]
    _refuse_both_names(verb.name, arguments, options)
    lists = {name for name, default in options.items() if isinstance(default, (list, tuple))}
    spelled = [_bracket(a, parse, sweep) if a.partition("=")[0] in lists else a for a in named]
    if not positional:
        return spelled
    given = [a for a in spelled if a.startswith(f"{key}=")]
    if key in lists:
        listed = [parse(a).value() for a in given]
        if not all(isinstance(value, list) for value in listed):
            raise ConfigError(
                f"{' '.join(given)}: {key} are a list, written '{key}=[a,b]'; or give them without {key}="
            )
        value = f"[{','.join(map(quote, [*positional, *(str(one) for value in listed for one in value)]))}]"
    elif len(positional + given) > 1:
        raise ConfigError(f"{verb.name}: one {word.lower()} at a time, not {' and '.join(positional + given)}")
    else:
        value = quote(positional[0])
    return [*(a for a in spelled if a not in given), f"{key}={value}"]


def _is_positional(argument: str) -> bool:
    # Hydra names folders seed=0
    return Path(argument).is_dir() or ("=" not in argument and not argument.startswith("-"))


def _rename(argument: str, options: Mapping[str, Any]) -> str:
    key, equals, value = argument.partition("=")
    other = OTHER_NAMES.get(key, "")
    if key in options or other not in options:
        return argument
    if not isinstance(options[other], list):
        value = value.strip("[]")
        if "," in value:
            raise ConfigError(f"{argument}: one {other} at a time: {other}={value.partition(',')[0]}")
    return f"{other}{equals}{value}"


def _refuse_both_names(verb: str, arguments: list[str], options: Mapping[str, Any]) -> None:
    """Raises ConfigError if an option is given under its other name, and once more."""
    for argument in arguments:
        key = _rename(argument, options).partition("=")[0]
        given = [a for a in arguments if _rename(a, options).partition("=")[0] == key]
        if len(given) > 1 and any(a.partition("=")[0] != key for a in given):
            several = (
                f"several {key} are given as '{key}=[A,B]'" if isinstance(options[key], list) else f"give one {key}"
            )
            raise ConfigError(f"{verb}: {' and '.join(given)} are the same option; {several}")


def _bracket(argument: str, parse: Callable[[str], Any], sweep: bool) -> str:
    """``key=value`` of a list with its value in brackets, if it is a single one."""
    key, _, text = argument.partition("=")
    try:
        parsed = parse(argument)
    except ConfigError:  # a single text with = in it, as effects and folders of sweeps have
        return argument if text.lstrip().startswith("[") else f"{key}=[{quote(text)}]"
    if parsed.is_sweep_override():
        values = list(parsed.sweep_string_iterator()) if sweep and parsed.is_discrete_sweep() else []
        return f"{key}={','.join(v if v.startswith('[') else f'[{v}]' for v in values)}" if values else argument
    value = parsed.value()
    if value is None or isinstance(value, (list, dict)):
        return argument
    return f"{key}=[{quote(value) if isinstance(value, str) else text}]"


def quote(text: str) -> str:
    """Text as Hydra reads it to the letter."""
    return "'" + re.sub(r"(\\*)('|\Z)", lambda found: 2 * found[1] + found[2].replace("'", "\\'"), text) + "'"
