"""``forcegrasp effects``: the catalogue of physical effects that a simulator may lack."""

from __future__ import annotations

import inspect
import textwrap
from typing import TYPE_CHECKING

from forcegrasp.errors import ConfigError

if TYPE_CHECKING:
    from forcegrasp.effects import Effect, Parameter

PURPOSE = "list the physical effects that a simulator may lack, or explain one"
HELP = f"""forcegrasp effects: {PURPOSE}

usage: forcegrasp effects [NAME]

  without a name   every effect by stage: symptom, and parameters with unit, bounds and a size worth noticing
  NAME             one in full: formula, source, variants, what looks like it, and what separates them

examples
  forcegrasp effects
  forcegrasp effects backlash

Other packages add effects under the entry point group forcegrasp.effects. Pictures of the symptoms: docs/effects/.
"""
WIDTH = 110


def main(arguments: list[str]) -> int:
    """Runs the verb; returns the exit status."""
    if {"-h", "--help"} & set(arguments):
        print(HELP, end="")
        return 0
    from forcegrasp.effects import get_effect

    if len(arguments) > 1:
        raise ConfigError(f"effects: one name at a time, not {' '.join(arguments)!r}; see forcegrasp effects --help")
    print(in_full(get_effect(arguments[0])) if arguments else overview(), end="")
    return 0


def overview() -> str:
    """Every effect by stage, with its symptom and parameters."""
    from forcegrasp.effects import STAGES, catalogue

    lines = []
    for stage in STAGES:
        lines += ["", stage] if lines else [stage]
        for effect in catalogue().values():
            if effect.stage == stage:
                lines += ["", f"  {effect.name}", *_wrapped(effect.symptom)]
                lines += [_parameter(p) for p in effect.parameters]
    return "\n".join([*lines, "", "forcegrasp effects NAME explains one of them.", ""])


def in_full(effect: type[Effect]) -> str:
    """Everything that an effect says about itself."""
    about = inspect.cleandoc(effect.__doc__ or "").replace("``", "")
    lines = [*textwrap.wrap(f"{effect.name}: {about.splitlines()[0]}", WIDTH), ""]
    rest = about.partition("\n\n")[2]
    if rest:
        lines += [*_wrapped(" ".join(rest.split()), indent=2), ""]
    rows = [
        ("stage", effect.stage),
        ("symptom", effect.symptom),
        ("formula", effect.formula),
        ("source", effect.source),
        ("variants", ", ".join(filter(None, effect.variants))),
        ("looks like", ", ".join(effect.look_alikes)),
        ("separated by", effect.separates),
    ]
    for title, text in rows:
        if text:
            first, *more = textwrap.wrap(text, WIDTH - 16)
            lines += [f"  {title:<13} {first}", *(f"{'':<16}{line}" for line in more)]
    if effect.parameters:
        lines += ["", "parameters", *(_parameter(p, indent=2) for p in effect.parameters)]
    return "\n".join(lines) + "\n"


def _parameter(p: Parameter, indent: int = 4) -> str:
    unit = "" if p.unit == "1" else f" {p.unit}"
    null = "" if p.null in (0, p.typical) else f", none at {p.null:g}"
    return f"{'':<{indent}}{p.name:<17} {p.doc}: {p.low:g} to {p.high:g}{unit}, typical {p.typical:g}{null}"


def _wrapped(text: str, indent: int = 4) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=" " * indent, subsequent_indent=" " * indent)
