"""The help text of a verb."""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Iterator
from typing import Any

from forcegrasp.cli.options import groups, leaves
from forcegrasp.cli.verb import Verb
from forcegrasp.config import is_left_out

#: Options of sections that a short help shows; those without a section are always there.
COMMON = (
    *("physics.threads", "grasp.kappa", "grasp.steps", "sensors.force_std_n"),
    *("ppo.total_frames", "ppo.grasps", "ppo.learning_rate", "log.video_every"),
)
HELP_WIDTH = 100


def help_text(verb: Verb, everything: bool) -> str:
    """Purpose, usage, notes, presets and options.

    Args:
      verb: that is explained.
      everything: every option with default, unit, meaning and source; else a line for each that is common, if options
        come in sections.
    """
    lines = [f"forcegrasp {verb.name}: {verb.purpose}", "", verb.usage_line]
    if verb.notes:
        lines += ["", verb.notes.strip("\n")]
    if verb.schema:
        presets = [f"  {name}={'|'.join(choices)}" for name, choices in groups(verb.name).items()]
        if presets:
            lines += ["", "presets (a preset sets several options; options given beside it win)", *presets]
        options = list(leaves(verb.schema))
        sectioned = any("." in name for name, _, _ in options)
        lines += _every_option(options) if everything or not sectioned else _common_options(verb.name, options)
    return "\n".join(lines) + "\n"


Option = tuple[str, dataclasses.Field, Any]


def _every_option(options: list[Option]) -> Iterator[str]:
    section = None
    for name, entry, default in options:
        head = name.rpartition(".")[0]
        if head != section:
            section = head
            yield from ("", head or "general")
        meta = entry.metadata
        detail = (
            meta["doc"]
            + (f" [{meta['unit']}]" if meta["unit"] else "")
            + (f" ({meta['source']})" if meta["source"] else "")
        )
        if not all(choice in detail for choice in meta["choices"]):
            detail += f": {' or '.join(meta['choices'])}"
        yield f"  {_with_default(name, entry, default)}\n{'':<6}{detail}"


def _common_options(verb: str, options: list[Option]) -> Iterator[str]:
    shown = [option for option in options if "." not in option[0] or option[0] in COMMON]
    yield from ("", "common options")
    for name, entry, default in shown:
        unit = f" [{entry.metadata['unit']}]" if entry.metadata["unit"] else ""
        head, text = _with_default(name, entry, default), entry.metadata["doc"] + unit
        first, *more = textwrap.wrap(f"  {head:<27} {text}", HELP_WIDTH, subsequent_indent=" " * 30)
        yield "\n".join([first, *more])
    sections = sorted({name.partition(".")[0] for name, _, _ in options if "." in name})
    yield f"\n{len(options) - len(shown)} more of {', '.join(sections)}:\n  forcegrasp {verb} --help --all"


def _with_default(name: str, entry: dataclasses.Field, default: Any) -> str:
    if entry.metadata["of_gripper"] and is_left_out(default):
        return f"{name}=(of gripper)"
    return f"{name}={str(default).replace(chr(39), '').replace(' ', '')}"
