"""What gripper and model add to a run's name, in ``conf/train.yaml``: ``${forcegrasp.in_name:${model}}``."""

from __future__ import annotations

import re
from pathlib import Path

from omegaconf import OmegaConf

from forcegrasp.assets import DEFAULT_GRIPPER

#: Letters of a gripper's or a model's name in the name of a run.
_LONGEST = 40


def in_name(name_or_path: str) -> str:
    """``_NAME`` of a gripper or a model file; nothing for the default gripper and where there is no model."""
    path = Path(name_or_path)
    if str(path) in (".", DEFAULT_GRIPPER):
        return ""
    stem = path.parent.name if path.stem == "model" and path.parent.name else path.stem  # runs/diagnose_TIME/model.yaml
    return "_" + re.sub(r"[^\w.-]", "_", stem)[:_LONGEST]


def register() -> None:
    """Makes it known to Hydra, in this process."""
    OmegaConf.register_new_resolver("forcegrasp.in_name", in_name, replace=True)
