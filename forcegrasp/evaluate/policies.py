"""The policies of a comparison: controllers by name, shipped policies by name, trained policies by run directory."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tensordict.nn import TensorDictModuleBase

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.config import ActionConfig, ObservationConfig, TrainConfig
from forcegrasp.controllers import CONTROLLERS, make_controller
from forcegrasp.errors import ConfigError, closest
from forcegrasp.physics import Gripper, load_gripper
from forcegrasp.policies import shipped_policies
from forcegrasp.runs.policy import load_policy
from forcegrasp.runs.run_dir import RunDir


@dataclass
class EvaluatedPolicy:
    """A policy under evaluation."""

    name: str
    policy: TensorDictModuleBase
    gripper: Gripper
    action: ActionConfig
    observation: ObservationConfig
    model: str = ""  #: what it was trained with, as it was named then
    model_file: Path | None = None  #: the run's own copy of it, if there is one


def load_policies(names: list[str], asked: str = "") -> list[EvaluatedPolicy]:
    """Loads controllers and policies; a controller's name wins over a policy's, and that over a folder's.

    All of them move one gripper: the one that is asked for; else that of the first trained policy; else the paper's.

    Args:
      names: of controllers or shipped policies, or run directories; ``FOLDER/*`` are all runs in a folder.
      asked: name or description of the gripper.

    Raises:
      ConfigError, CheckpointError: if one can't be loaded, or was trained on another gripper.
    """
    if not all(names):
        raise ConfigError(f"policies={names}: a name is empty")
    names = [run for name in names for run in _runs(name)]
    paths = {name: Path(name).resolve() for name in names}
    trained = {name: _trained(name, path) for name, path in paths.items() if name not in CONTROLLERS}
    gripper = load_gripper(asked or next((config.gripper for _, config in trained.values()), DEFAULT_GRIPPER))
    loaded: dict[str, EvaluatedPolicy] = {}
    for name, path in paths.items():
        if name in CONTROLLERS:
            label, policy = name, make_controller(name, gripper)
            config = TrainConfig(action=ActionConfig(inductive_bias=False))
        else:
            same = [other for other in set(paths.values()) if other.name == path.name]
            label = path.name if len(same) == 1 else f"{path.parent.name}_{path.name}"
            if path.suffix == ".safetensors":  # RUN/checkpoints/best.safetensors
                label = f"{path.parent.parent.name}_{path.stem}"
            policy, config = trained[name]
            own = load_gripper(config.gripper)
            if own.name != gripper.name:
                raise ConfigError(f"policies: {name} was trained on gripper {own.name}, and can't move {gripper.name}")
        if label in loaded:
            raise ConfigError(f"policies: {label} is named twice")
        parts = gripper, config.action, config.observation
        loaded[label] = EvaluatedPolicy(label, policy, *parts, config.model, _model_file(name, config))
    if len(paths) < len(names):
        raise ConfigError(f"policies={names}: one is named twice")
    return list(loaded.values())


def _runs(name: str) -> list[str]:
    """The name; of ``FOLDER/*`` those of all runs in the folder."""
    if not name.endswith("/*"):
        return [name]
    folder = Path(name.removesuffix("/*"))
    runs = sorted(str(config.parent) for config in folder.glob("*/config.yaml"))
    if not runs:
        raise ConfigError(f"policies: {name}: there is no run in {folder}; a run is what forcegrasp train wrote")
    return runs


def _trained(name: str, path: Path) -> tuple[TensorDictModuleBase, TrainConfig]:
    known = [*CONTROLLERS, *shipped_policies()]
    if name not in known and not ("/" in name or path.exists()):
        raise ConfigError(f"no controller, policy or run directory named {name!r}{closest(name, known)}")
    return load_policy(name)


def _model_file(name: str, config: TrainConfig) -> Path | None:
    if not config.model or name in shipped_policies():
        return None
    path = Path(name)
    copy = RunDir(path.parent.parent if path.suffix == ".safetensors" else path).model_path
    return copy if copy.is_file() else None
