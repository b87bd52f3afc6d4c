"""Runs the public commands as anyone would, and remembers what was run and how long it took."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass
class Verbs:
    """The commands of one recording's study, each once: what there is already is not done again."""

    out: Path  #: folder of all results of this study
    done: dict[str, dict[str, Any]] = field(default_factory=dict)  #: name of a step → command, seconds

    def __post_init__(self) -> None:
        self.out.mkdir(parents=True, exist_ok=True)
        if self._file.is_file():
            self.done = json.loads(self._file.read_text())

    @property
    def _file(self) -> Path:
        return self.out / "commands.json"

    def seconds(self, *steps: str) -> float:
        """Of these steps together, or of all; one that was done before counts what it took then."""
        return sum(self.done[step]["seconds"] for step in steps or self.done)

    def run(self, step: str, verb: str, *arguments: str, makes: str | Path) -> Path:
        """Runs ``forcegrasp verb arguments out=makes``, unless this very command was run before; returns its folder.

        Raises:
          RuntimeError: if it fails; the log has the rest.
        """
        folder = self.out / makes
        command = [verb, *arguments, f"out={folder}"]
        if self.done.get(step, {}).get("command") == command and folder.exists():
            return folder
        print(f"  [{time.strftime('%H:%M:%S')}] {self.out.name}: forcegrasp {' '.join(command)}", flush=True)
        start = time.monotonic()
        with open(self.out / f"{step}.log", "w") as log:
            code = subprocess.run(
                [sys.executable, "-m", "forcegrasp.cli.main", *command], stdout=log, stderr=subprocess.STDOUT
            ).returncode
        if code:
            last = (self.out / f"{step}.log").read_text().strip().splitlines()[-1:]
            raise RuntimeError(f"forcegrasp {' '.join(command)}: {' '.join(last)}")
        self.done[step] = {"command": command, "seconds": round(time.monotonic() - start, 1)}
        self._file.write_text(json.dumps(self.done, indent=1))
        return folder

    def diagnosis(self, step: str, data: Path, *options: str) -> dict[str, Any]:
        """Diagnoses a set; returns what `diagnosis.json` holds."""
        folder = self.run(step, "diagnose", f"data={data}", *options, makes=step)
        return json.loads((folder / "diagnosis.json").read_text())
