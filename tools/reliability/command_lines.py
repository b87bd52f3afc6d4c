"""Wrong command lines, put together at random: each is answered in one line, exit status 2, and nothing is written."""

from __future__ import annotations

import contextlib
import io
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from forcegrasp.cli.main import main
from forcegrasp.cli.options import SCHEMAS, groups, leaves
from tools.reliability.child import each
from tools.reliability.trial import Promise, Trial

SECONDS = 5.0
#: What makes each line wrong, whatever else is in it. It comes last.
WRONG = {
    "record": ["model=nowhere"],
    "compare": ["data=nowhere"],
    "fit": ["nowhere"],
    "diagnose": ["data=nowhere"],
    "add": ["nowhere", "model=nowhere", "effect=backlash"],
    "train": ["model=nowhere"],
    "evaluate": ["policies=nowhere"],
    "export": ["nowhere"],
    "curves": ["nowhere"],
    "render": ["policy=nowhere"],
    "effects": ["nowhere"],
    "nowhere": [],
}
_VALUES = [
    *("", "[", "]", "[]", "[[1]]", "{", "{a: 1", "{a: 1}", "'", '"', "'a", "a b", "a,b", ",", "=", "==", "a=b"),
    *("0", "-1", "1e999", "nan", "inf", "1.5", "true", "null", "~", "???", "x", "ü", "\u202e", "\n", "\t", "\\"),
    *("$", "${", "${x}", "${oc.env:HOME}", "$(true)", "`true`", "range(1,3)", "glob(*)", "choice(1,2)", "sort(3,1)"),
    *("int(x)", "(", "!!python/name:os.system", "../..", "/dev/null", ".", "%", "#"),
    *("x" * 5000, "[" * 200, "9" * 400),
]


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Each is a verb with one to three odd arguments, and what makes it wrong in any case."""
    with tempfile.TemporaryDirectory() as folder:
        rng = np.random.default_rng(seed)
        lines = [_line(rng) for _ in range(count)]
        for line, complaint, problem in each(lines, lambda line: _attempt(line, Path(folder)), SECONDS):
            yield Trial(" ".join(line)[:200], problem or complaint, line[0])


def _line(rng: np.random.Generator) -> list[str]:
    verb = str(rng.choice(list(WRONG)))
    known = [name for name, _, _ in leaves(SCHEMAS[verb])] + list(groups(verb)) if verb in SCHEMAS else ["name"]
    odd = [_argument(known, rng) for _ in range(rng.integers(1, 4))]
    return [verb, *odd, *WRONG[verb]]


def _argument(known: list[str], rng: np.random.Generator) -> str:
    """An option that there is with an odd value, or one that there is not."""
    key, value = str(rng.choice(known)), _VALUES[rng.integers(len(_VALUES))]
    at = int(rng.integers(len(key) + 1))
    match int(rng.integers(9)):
        case 0:
            key = key[:at] + key[at + 1 :]
        case 1:
            key = key[:at] + "_" + key[at:]
        case 2:
            key = str(rng.choice(["+", "++", "~", "-", "--", "@", "hydra.", "hydra/", " "])) + key
        case 3:
            key = key.upper()
        case 4:
            return value if value not in (".", "../..") else key
        case _:
            pass
    return f"{key}={value}"


def _attempt(line: list[str], folder: Path) -> str:
    """Returns what is wrong with the answer, if anything is."""
    os.chdir(folder)
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main(line)
    said = err.getvalue()
    if status != 2 or out.getvalue():
        return f"exit status {status}, printed {out.getvalue()[:100]!r}"
    if said.count("\n") != 1 or not said.startswith("forcegrasp: ") or "Traceback" in said:
        return f"not one line: {said[:300]!r}"
    if not said.strip().isprintable() or len(said) > 6000:
        return f"not a line to read: {said[:300]!r}"
    written = [path.name for path in folder.iterdir()]
    return f"wrote {written}" if written else ""


PROMISE = Promise("a wrong command line is answered in one line and with nothing written", 200, 24, trials)
