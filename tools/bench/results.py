"""What a run of the benchmark found, as JSON and back."""

from __future__ import annotations

import dataclasses
import importlib.metadata
import json
import platform
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from forcegrasp.cores import usable_cores
from tools.bench.case import Case, Learning, Measured

#: The level that others are held against.
ENGINE = "raw engine"
PACKAGES = ("mujoco", "torch", "torchrl", "gymnasium", "stable-baselines3")


@dataclass
class Results:
    """All that was measured.

    Args:
      processes: of each peer.
      levels, peers: beside each other, in turns.
      by_grasps, by_threads: how the levels grow.
      learning: trainings until a force reward.
      machine: what it ran on.
    """

    processes: int
    levels: list[Measured] = field(default_factory=list)
    peers: list[Measured] = field(default_factory=list)
    by_grasps: list[Measured] = field(default_factory=list)
    by_threads: list[Measured] = field(default_factory=list)
    learning: list[Learning] = field(default_factory=list)
    machine: dict[str, Any] = field(default_factory=dict)

    def rate(self, name: str, tier: str) -> float | None:
        """Steps per second of a level or peer; None if it was not measured."""
        found = (m.steps_per_second for m in [*self.levels, *self.peers] if (m.case.name, m.case.tier) == (name, tier))
        return next(found, None)

    def share_of_engine(self, found: Measured) -> float | None:
        """Frames per second of a level ÷ those of the raw engine in the same run; None without it."""
        engine = self.rate(ENGINE, found.case.tier)
        return found.steps_per_second / engine if engine else None

    def write(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(dataclasses.asdict(self), indent=1) + "\n", "utf-8")

    @classmethod
    def read(cls, path: Path) -> Results:
        parts = json.loads(path.read_text("utf-8"))
        for name in ("levels", "peers", "by_grasps", "by_threads"):
            parts[name] = [Measured(**(one | {"case": Case(**one["case"])})) for one in parts[name]]
        parts["learning"] = [
            Learning(**(one | {"curve": [tuple(point) for point in one["curve"]]})) for one in parts["learning"]
        ]
        return cls(**parts)


def machine() -> dict[str, Any]:
    """Processor, cores and versions."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        processor = next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        processor = platform.machine()
    versions = {}
    for name in PACKAGES:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return {"processor": processor, "cores": usable_cores(), "python": platform.python_version(), **versions}
