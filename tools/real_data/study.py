"""What a study of one set of recordings brings home, as plain data that the page and the pictures are made of."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class Parameter:
    """A fitted number beside the published one."""

    name: str
    value: float
    low: float  #: of the 95 % interval
    high: float
    unit: str
    published: float | None = None


@dataclass
class Error:
    """Root mean square of what is left of a signal that nothing was fitted to."""

    signal: str
    unit: str
    before: float
    after: float
    noise: float  #: that the comparison assumes
    yardstick: float | None = None


@dataclass
class Study:
    """All that is told of one set."""

    name: str
    title: str
    base: str  #: what the base model has
    split: str  #: what was fitted, what was judged
    files: dict[str, str] = field(default_factory=dict)  #: path below the folder of the data → SHA-256
    commands: list[str] = field(default_factory=list)
    verdict: str = ""
    reason: str = ""
    found: list[str] = field(default_factory=list)  #: effects in the order in which they were found
    rivals: list[str] = field(default_factory=list)  #: that these data can't tell from them
    errors: list[Error] = field(default_factory=list)
    parameters: list[Parameter] = field(default_factory=list)
    tables: dict[str, list[list[str]]] = field(default_factory=dict)  #: further tables, first row the header
    notes: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def write(self, folder: Path) -> None:
        (folder / "study.json").write_text(json.dumps(dataclasses.asdict(self), indent=1, ensure_ascii=False))

    @classmethod
    def read(cls, folder: Path) -> Study:
        raw = json.loads((folder / "study.json").read_text())
        raw["errors"] = [Error(**e) for e in raw["errors"]]
        raw["parameters"] = [Parameter(**p) for p in raw["parameters"]]
        return cls(**raw)

    def take_diagnosis(self, found: dict, published: dict[str, float] | None = None) -> None:
        """Takes verdict and effects, and the parameters of effects, from a `diagnosis.json`."""
        self.verdict, self.reason = found["verdict"], found["reason"]
        steps = found_steps(found)
        self.found = [step[0] for step in steps]
        self.rivals = [name for step in steps for name in step[1:]]
        for effect, parameters in found["parameters"].items():
            for name, p in parameters.items():
                if effect != "quantisation":
                    key = f"{effect}.{name}"
                    self.parameters.append(
                        Parameter(key, p["value"], p["low"], p["high"], p["unit"], (published or {}).get(key))
                    )


def found_steps(found: dict) -> list[list[str]]:
    """Of a `diagnosis.json` the effects of each step that found some, then their rivals; rounding is noise."""
    return [step["effects"] for step in found["steps"] if step["effects"] and step["effects"][0] != "quantisation"]


def checksums(data: Path, files: list[Path]) -> dict[str, str]:
    """SHA-256 of files, by their paths below the folder of the data."""
    return {str(f.relative_to(data)): hashlib.sha256(f.read_bytes()).hexdigest() for f in sorted(files)}
