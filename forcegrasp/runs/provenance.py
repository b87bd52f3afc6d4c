"""What a run was started with, by the command that it recorded."""

from __future__ import annotations

import json
from pathlib import Path

from forcegrasp.files.bounded import read_bytes

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
