"""``run.json``: what a run was started with, and where."""

from __future__ import annotations

import dataclasses
import functools
import json
import os
import platform
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

from forcegrasp.config import TrainConfig
from forcegrasp.files.bounded import read_bytes
from forcegrasp.runs.config_file import fingerprint

_PACKAGES = ("torch", "torchrl", "tensordict", "mujoco", "gymnasium", "hydra-core", "numpy")
_MAX_BYTES = 1_000_000
#: The preset of a run whose command names none, see conf/train.yaml.
DEFAULT_EXPERIMENT = "ib"


def experiment(run: Path) -> str:
    """Returns the name of a run's experiment; an empty one if ``run.json`` does not tell."""
    try:
        command = json.loads(read_bytes(run / "run.json", _MAX_BYTES))["command"]
        named = [str(word).partition("=")[2] for word in command if str(word).startswith("experiment=")]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return ""
    return named[-1] if named else DEFAULT_EXPERIMENT


def provenance(config: TrainConfig, overrides: list[str]) -> dict[str, Any]:
    """Command, seed, versions and machine of a run that starts here and now."""
    return {
        "command": ["forcegrasp", "train", *overrides],
        "seed": config.seed,
        "config": fingerprint(dataclasses.asdict(config)),
        **_code_and_machine(),
    }


@functools.cache  # a process runs the code that it imported, in each run of a sweep
def _code_and_machine() -> dict[str, Any]:
    return {
        "git": git_hash(),
        "python": sys.version.split()[0],
        "versions": {name: version(name) for name in _PACKAGES} | {"forcegrasp": version("forcegrasp")},
        "machine": {"system": platform.platform(), "processor": platform.machine(), "cores": os.cpu_count()},
    }


def git_hash() -> str | None:
    """Commit of the source tree, with "+" where it has changes; None outside a checkout."""
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():
        return None

    def git(*arguments: str) -> str:
        return subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=True).stdout.strip()

    try:
        return git("rev-parse", "HEAD") + ("+" if git("status", "--porcelain") else "")
    except (OSError, subprocess.CalledProcessError):
        return None
