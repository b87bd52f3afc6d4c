"""YAML that names objects, or asks for more memory than there is, in each kind of file that is read."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import yaml

from forcegrasp.config import GraspConfig
from forcegrasp.evaluate.grids import read_objects
from forcegrasp.measure import read_set
from forcegrasp.models.model_file import read_model
from forcegrasp.physics.gripper import shipped_folder
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.runs.history import find_histories
from forcegrasp.runs.run_dir import RunDir
from tools.reliability.attacks.attack import MARK, Attack, not_files, replace

TOUCH = f"touch {MARK}"
#: A value that would be built by a careless reader.
OBJECTS = [
    f"!!python/object/apply:os.system ['{TOUCH}']",
    f"!!python/object/new:os.system ['{TOUCH}']",
    f"!!python/object/apply:subprocess.Popen [[touch, {MARK}]]",
    f"!!python/object/apply:builtins.eval [\"open('{MARK}', 'w')\"]",
    f"!<tag:yaml.org,2002:python/object/apply:os.system> ['{TOUCH}']",
    f"!!python/object/apply:pathlib.Path.touch [!!python/object/apply:pathlib.Path [{MARK}]]",
    "!!python/name:os.system",
    "!!python/module:os",
    "!!python/tuple [1, 2]",
    f"{{_target_: os.system, _args_: ['{TOUCH}']}}",
    f"{{_target_: builtins.open, file: {MARK}, mode: w}}",
    "!!binary aGVsbG8=",
    "!!set {a, b}",
    f"'${{oc.create:{{_target_: os.system, command: {TOUCH}}}}}'",
]


def _doubling(item: str) -> str:
    """Ten lines that stand for 10⁹ items."""
    lines = [f"a0: &a0 {item}"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 10)]
    return "\n".join(lines)


def _merging() -> str:
    lines = ["a0: &a0 {k: v}"]
    lines += [f"a{n}: &a{n} {{<<: [{', '.join([f'*a{n - 1}'] * 10)}]}}" for n in range(1, 10)]
    return "\n".join(lines)


#: Whole files that ask for too much time, memory or depth.
BOMBS: dict[str, Callable[[], str]] = {
    "aliases": partial(_doubling, "[lol, lol, lol]"),
    "merged mappings": _merging,
    "an alias of itself": lambda: "a: &a [*a]",
    "lists in lists": lambda: "a: " + "[" * 200_000,
    "mappings in mappings": lambda: "{a: " * 100_000,
    "lines within lines": lambda: "\n".join(" " * n + "a:" for n in range(1200)),
    "dashes": lambda: "- " * 300_000,
    "questions": lambda: "? " * 300_000,
    "a million keys": lambda: "".join(f"k{n}: 1\n" for n in range(1_000_000)),
    "a text of 50 MB": lambda: "a: " + "x" * 50_000_000,
    "a number of a million digits": lambda: "a: " + "9" * 900_000,
    "a number of a million sixtieths": lambda: "a: 1" + ":59" * 300_000,
    "an open quotation": lambda: 'a: "' + "x\\n" * 300_000,
    "comments": lambda: "# \n" * 400_000,
    "documents": lambda: "---\na: 1\n" * 100_000,
    "control characters": lambda: "a: \x00\x01\x02",
}


def _sound(kind: str) -> str:
    """What a sound file of the kind says."""
    if kind == "meta.yaml":
        return "format: forcegrasp-measurements/1\nkind: grasps\ngripper: tiago\nsource: me\nlicense: none\n"
    if kind == "config.yaml":
        return yaml.safe_dump({"seed": 3, "model": "", "grasp": {"kappa": [0, 1]}, "ppo": {"total_frames": 8}})
    shipped = {"model.yaml": "virtual_robot.yaml", "gripper.yaml": "tiago.yaml", "objects.yaml": "paper_objects.yaml"}
    return (shipped_folder() / shipped[kind]).read_text("utf-8")


READERS: dict[str, Callable[[], object]] = {
    "meta.yaml": lambda: read_set("."),
    "model.yaml": lambda: read_model(Path("model.yaml")),
    "gripper.yaml": lambda: load_gripper("./gripper.yaml"),
    "objects.yaml": lambda: read_objects("objects.yaml", GraspConfig()),
    "config.yaml": lambda: RunDir.open(".").config(),
    "config.yaml of a sweep": lambda: find_histories([Path()], ["x"]),
}


def attacks() -> Iterator[Attack]:
    for reader, read in READERS.items():
        kind = reader.partition(" ")[0]
        for payload in OBJECTS:
            # the others are text or a mapping, which some keys may hold
            known = payload.startswith("!")
            yield Attack(f"{reader}: as a value: {payload}", partial(_as_value, kind, payload), read, known)
            yield Attack(f"{reader}: as the file: {payload}", partial(_write, kind, payload), read, known)
        for name, bomb in BOMBS.items():
            yield Attack(f"{reader}: {name}", lambda kind=kind, bomb=bomb: _write(kind, bomb()), read)
        for name, make in not_files():
            yield Attack(f"{reader}: {name}", partial(_not_a_file, kind, make), read)


def _write(kind: str, text: str) -> None:
    Path(kind).write_text(text)
    Path("metrics.csv").write_text("frames,x\n8,1\n")


def _as_value(kind: str, payload: str) -> None:
    """Puts the payload where the second key of a sound file has its value."""
    _write(kind, _sound(kind))
    if kind == "gripper.yaml":
        shutil.copy(shipped_folder() / "tiago.xml", "tiago.xml")
    lines = Path(kind).read_text().splitlines()
    index = [n for n, line in enumerate(lines) if ":" in line and not line.startswith((" ", "#"))][1]
    while index + 1 < len(lines) and lines[index + 1].startswith((" ", "-")):
        del lines[index + 1]
    lines[index] = f"{lines[index].partition(':')[0]}: {payload}"
    _write(kind, "\n".join(lines) + "\n")


def _not_a_file(kind: str, make: Callable[[Path], object]) -> None:
    _write(kind, "")
    replace(Path(kind), make)
