"""Makes docs/configuration.md: every option of every verb, out of what forcegrasp/config and conf/ say.

python tools/config_page.py [--out docs/configuration.md]
"""

from __future__ import annotations

import argparse
import dataclasses
import inspect
import math
import shlex
from collections.abc import Iterable, Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import yaml

from forcegrasp.cli.options import SCHEMAS, groups
from forcegrasp.cli.verbs import VERBS
from forcegrasp.config import is_left_out

#: Upper bounds from here on only keep out what can be no number of anything.
MANY = 100_000
HEAD = """# Configuration

Every option of every verb, with its default, what it may be and where the default comes from.
`forcegrasp VERB --help --all` says the same in the terminal. This page is made by `python tools/config_page.py`.

```sh
forcegrasp train experiment=ib reward.object_weight=2 'grasp.kappa=[0.3,0.6]'    # NAME=VALUE; quotes around a list
forcegrasp train experiment=no_ib physics=reference seed=3                       # a preset sets several options
forcegrasp train -m seed=0,1,2 sensors=paper,authors                             # -m: every combination of these
forcegrasp train hydra.run.dir=runs/mine                                         # where a training writes
```

- **A preset** is a file in `conf/` that says only what differs from the defaults. Options given beside it win.
- **A range** is `[low, high]`, drawn uniformly. **A unit** ends the name where there is one: `_m` metres, `_n` newtons.
- **A list of one** may be typed without brackets (`policies=ib`, `effects=backlash`), `policy=` is `policies=`, and
  a set needs no `data=` (`forcegrasp compare my_set`).
- **A misspelt name or a value out of bounds** is refused in one line, before anything is written.
- **What a run used** is in its folder, as `config.yaml`.

Source "paper" is Lach et al. (2023); "authors' code" is that paper's public code where the paper is silent; defaults
without a source were chosen here. Where paper and code disagree:
[differences from the paper](differences-from-the-paper.md).
"""


def page() -> str:
    """The whole page: verbs with their own options, then the parts that verbs share."""
    lines, shared = [HEAD, "## Verbs\n"], {}
    for verb, schema in SCHEMAS.items():
        inner = dict(parts(schema))
        shared |= inner
        own = [entry for entry in dataclasses.fields(schema) if entry.name not in inner]
        purpose = VERBS[verb].purpose
        lines += [f"### {verb}\n", f"{purpose[0].upper()}{purpose[1:]}.\n", table(own), presets(verb)]
        if inner:
            names = ", ".join(f"[{name}](#{name})" for name in inner)
            lines += [f"And the options of {names}{differing(schema)}\n"]
    lines += ["## Parts\n"]
    for name, part in shared.items():
        lines += [f"### {name}\n", f"`{part.__name__}`: {said_of(part)}\n", table(dataclasses.fields(part), f"{name}.")]
    return "\n".join(line for line in lines if line).rstrip() + "\n"


def parts(schema: type) -> Iterator[tuple[str, type]]:
    """Names and classes of the dataclasses in a dataclass."""
    for entry in dataclasses.fields(schema):
        if dataclasses.is_dataclass(value := default(entry)):
            yield entry.name, type(value)


def default(entry: dataclasses.Field) -> Any:
    """The value that a field starts with."""
    return entry.default_factory() if entry.default is dataclasses.MISSING else entry.default  # pyright: ignore


def differing(schema: type) -> str:
    """Which options of its parts have another default in a verb."""
    found = [
        f"`{name}.{inner.name}={shown(value)}`"
        for name, part in parts(schema)
        for inner in dataclasses.fields(part)
        if shown(value := getattr(getattr(schema(), name), inner.name)) != shown(getattr(part(), inner.name))
    ]
    return f"; here {', '.join(found)}." if found else "."


def said_of(part: type) -> str:
    """A class's docstring, to go on a line."""
    text = " ".join(inspect.cleandoc(part.__doc__ or "").replace("``", "`").split())
    return text if text[1:2].isspace() else text[0].lower() + text[1:]


def table(entries: Iterable[dataclasses.Field], prefix: str = "") -> str:
    """A row for each option."""
    rows = ["| option | default | unit | may be | meaning | source |", "|---|---|---|---|---|---|"]
    for entry in entries:
        meta, start = entry.metadata, default(entry)
        text = "the gripper's" if meta["of_gripper"] and is_left_out(start) else f"`{shown(start)}`"
        cells = (f"`{prefix}{entry.name}`", text, meta["unit"], allowed(entry), meta["doc"], meta["source"])
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(rows) + "\n"


def shown(value: Any) -> str:
    """A default as it would be typed."""
    if isinstance(value, bool) or value is None:
        return {True: "true", False: "false", None: "null"}[value]
    if isinstance(value, list):
        return "[" + ",".join(map(shown, value)) + "]"
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value) if value != "" else "''"


def allowed(entry: dataclasses.Field) -> str:
    """Choices, or bounds."""
    meta = entry.metadata
    if meta["choices"]:
        return " ".join(f"`{choice}`" for choice in meta["choices"])
    if isinstance(default(entry), bool):
        return "`true` `false`"
    low, high = meta["low"], meta["high"]
    if math.isinf(low):
        return ""
    return f"{low:g} to {high:g}" if high < MANY else f"{low:g} or more"


def presets(verb: str) -> str:
    """The presets of a verb, and what each sets."""
    rows = [
        f"| `{group}={name}` | {', '.join(what(verb, group, name)) or 'the defaults'} |"
        for group, names in groups(verb).items()
        for name in names
    ]
    return "\n".join(["| preset | sets |", "|---|---|", *rows]) + "\n" if rows else ""


def what(verb: str, group: str, name: str) -> Iterator[str]:
    """What the file of a preset sets: other presets, then options."""
    own = files("forcegrasp.conf") / verb / group
    folder = own if own.is_dir() else files("forcegrasp.conf") / group
    text = (folder / f"{name}.yaml").read_text("utf-8")
    content = yaml.safe_load(text) or {}
    for above in content.pop("defaults", []):
        if isinstance(above, dict):
            yield from (f"`{key.removeprefix('override /')}={value}`" for key, value in above.items())
        elif above != "_self_":
            yield f"`{group}={above}`"
    swept = content.pop("hydra", {}).get("sweeper", {}).get("params", {})
    whole = text.startswith("# @package _global_")
    for key, value in flat(swept | content, "" if whole else f"{group}."):
        setting = f"{key}={shown(value)}"
        yield f"`{shlex.quote(setting) if '[' in setting else setting}`"


def flat(content: dict, prefix: str) -> Iterator[tuple[str, Any]]:
    """Dotted names and values."""
    for key, value in content.items():
        if isinstance(value, dict):
            yield from flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[1] / "docs/configuration.md")
    parser.parse_args().out.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
