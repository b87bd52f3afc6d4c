"""Trained policies that come with the package, each laid out like a run directory, with a card beside it.

``tools/ship_policy.py`` puts them here.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

FOLDER = Path(str(files(__name__)))


def shipped_policies() -> list[str]:
    """Their names."""
    return sorted(folder.name for folder in FOLDER.iterdir() if (folder / "config.yaml").is_file())
