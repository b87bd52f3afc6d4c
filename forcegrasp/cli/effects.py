"""``forcegrasp effects``: the catalogue of physical effects that a simulator may lack."""

from __future__ import annotations

import inspect
import textwrap
from typing import TYPE_CHECKING

from forcegrasp.cli.verb import Verb
from forcegrasp.errors import ConfigError, closest

if TYPE_CHECKING:
    from collections.abc import Iterable

    from forcegrasp.effects import Effect, Nested, Parameter

NOTES = """
  without a name   every effect by stage: family, symptom, and parameters with unit, bounds and a size worth noticing
  NAME             one in full: formula, source, variants, what looks like it, and what separates them
  gripper=GRIPPER  as that gripper has them, by name or the path of a description: as many parameters as it has motors
                   or force readings, in its units, with its sizes; without it those of the catalogue

examples
  forcegrasp effects
  forcegrasp effects backlash
  forcegrasp effects backlash gripper=so101_gripper

Other packages add effects under the entry point group forcegrasp.effects. Pictures of the symptoms: docs/effects/.
"""
WIDTH = 110


def run(arguments: list[str]) -> None:
    """Runs the verb."""
    from forcegrasp.effects import catalogue, get_effect

    names, given = [], []
    for argument in arguments:
        key, equals, value = argument.partition("=")
        if equals and key != "gripper":
            raise ConfigError(f"no option {key!r}{closest(key, ['gripper'])}")
        (given if equals else names).append(value if equals else argument)
    for what, several in (("name", names), ("gripper", given)):
        if len(several) > 1:
            raise ConfigError(
                f"effects: one {what} at a time, not {' '.join(several)!r}; see forcegrasp effects --help"
            )
    if not given:
        print(in_full(get_effect(names[0])) if names else overview(catalogue().values()), end="")
        them = "it, in its units" if names else "them, in its units, and which it can't have"
        print(f"With gripper=GRIPPER: as that gripper has {them}.")
        return
    from forcegrasp.effects.for_gripper import effect_of, effects_of, why_left_out
    from forcegrasp.physics import load_gripper

    gripper = load_gripper(given[0])
    if names:
        print(in_full(effect_of(names[0], gripper)), end="")
        return
    print(overview(effects_of(gripper).values()), end="")
    left_out: dict[str, list[str]] = {}
    for effect in catalogue().values():
        left_out.setdefault(why_left_out(effect, gripper), []).append(effect.name)
    for why in filter(None, left_out):
        print(*textwrap.wrap(f"Left out: {', '.join(left_out[why])}. Each {why}.", WIDTH), sep="\n")


def overview(effects: Iterable[type[Effect]]) -> str:
    """The effects by stage, with their symptoms and parameters."""
    from forcegrasp.effects import STAGES

    lines, effects = [], list(effects)
    for stage in STAGES:
        lines += ["", stage] if lines else [stage]
        for effect in effects:
            if effect.stage == stage:
                lines += ["", f"  {effect.name}", *_wrapped(f"{effect.family}: {effect.symptom}")]
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
        ("family", effect.family),
        ("symptom", effect.symptom),
        ("formula", effect.formula),
        ("source", effect.source),
        ("variants", ", ".join(filter(None, effect.variants))),
        ("looks like", ", ".join(effect.look_alikes)),
        ("separated by", effect.separates),
        ("contains", "; ".join(map(contained, effect.contains))),
    ]
    for title, text in rows:
        if text:
            first, *more = textwrap.wrap(text, WIDTH - 16)
            lines += [f"  {title:<13} {first}", *(f"{'':<16}{line}" for line in more)]
    if effect.parameters:
        lines += ["", "parameters", *(_parameter(p, indent=2) for p in effect.parameters)]
    return "\n".join(lines) + "\n"


def contained(nested: Nested) -> str:
    """A simpler effect that an effect is at certain values, in words."""
    return f"{nested.effect}, at " + ", ".join(f"{name} = {value:g}" for name, value in nested.at.items())


def _parameter(p: Parameter, indent: int = 4) -> str:
    unit = "" if p.unit == "1" else f" {p.unit}"
    null = "" if p.null in (0, p.typical) else f", none at {p.null:g}"
    return f"{'':<{indent}}{p.name:<17} {p.doc}: {p.low:g} to {p.high:g}{unit}, typical {p.typical:g}{null}"


def _wrapped(text: str, indent: int = 4) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=" " * indent, subsequent_indent=" " * indent)


VERB = Verb(
    "effects",
    "list the physical effects that a simulator may lack, or explain one",
    run=run,
    notes=NOTES,
    positional=("effect", "NAME"),
    usage="[gripper=GRIPPER]",
)
