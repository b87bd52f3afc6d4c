"""A run directory: resolved config, provenance, metrics and checkpoints, enough to understand and resume a run."""

from __future__ import annotations

import csv
import dataclasses
import functools
import hashlib
import io
import json
import math
import os
import platform
import subprocess
import sys
from contextlib import AbstractContextManager
from importlib.metadata import version
from pathlib import Path
from typing import Any, cast

import yaml
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from torch import Tensor

from forcegrasp.config import TrainConfig, validate
from forcegrasp.errors import CheckpointError, ConfigError
from forcegrasp.files import plain_yaml
from forcegrasp.files.whole_file import write_whole
from forcegrasp.models.model_file import Model, write_model
from forcegrasp.models.variation import read_model_of, with_noise_of
from forcegrasp.physics import load_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.runs import checkpoint
from forcegrasp.runs.lock import only_writer

_PACKAGES = ("torch", "torchrl", "tensordict", "mujoco", "gymnasium", "hydra-core", "numpy")


def _refuse_interpolations(options: dict[str, Any], path: str = "") -> None:
    """Raises ConfigError where a value asks for another one, such as a variable of the reader's environment."""
    for name, value in options.items():
        if isinstance(value, dict):
            _refuse_interpolations(value, f"{path}{name}.")
        elif "${" in str(value):
            raise ConfigError(f"{path}{name}={value}: ${{...}} is not replaced in a file; write the value itself")


def fingerprint(options: dict[str, Any]) -> str:
    """Identifies a training by its options as config.yaml has them; checkpoints carry it.

    Options that came into being after the run was made are not among them, so that old runs stay readable.
    """
    return hashlib.sha256(json.dumps(options, sort_keys=True).encode()).hexdigest()[:16]


class RunDir:
    """The files of one training run."""

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self.config_path = self.path / "config.yaml"
        self.metrics_path = self.path / "metrics.csv"
        self.model_path = self.path / "model.yaml"
        self.checkpoints = self.path / "checkpoints"
        self.best = self.checkpoints / "best.safetensors"
        self.tensorboard = self.path / "tensorboard"
        self.figures = self.path / "figures"

    @classmethod
    def create(cls, path: Path | str, config: TrainConfig, overrides: list[str]) -> RunDir:
        """Makes a new run directory and writes config and provenance into it.

        One that holds the same run is begun again, as long as it has no checkpoint.

        Raises:
          CheckpointError: if the directory already holds a run, is being written, or can't be.
        """
        run = cls(path)
        try:
            with run.only_writer():
                if run.config_path.exists() and (run.has_checkpoint or not run._is_of(config)):
                    raise CheckpointError(
                        f"{run.path}: already holds a run; continue it with resume={run.path}, or name another"
                    )
                for folder in (run.checkpoints, run.tensorboard, run.figures):
                    folder.mkdir(parents=True, exist_ok=True)
                run.model_path.unlink(missing_ok=True)  # of a run that is begun again: its source may have changed
                facts = json.dumps(_provenance(config, overrides), indent=2) + "\n"
                write_whole(run.path / "run.json", facts.encode())
                text = yaml.safe_dump(dataclasses.asdict(config), sort_keys=False)
                write_whole(run.config_path, text.encode())  # last: a folder without it is no run
        except OSError as error:
            raise CheckpointError(f"{run.path}: could not make the run directory ({error.strerror})") from error
        return run

    def only_writer(self) -> AbstractContextManager[None]:
        """Held by whoever writes the run, see :func:`~forcegrasp.runs.lock.only_writer`."""
        return only_writer(self.path / "lock")

    @property
    def has_checkpoint(self) -> bool:
        """Whether there is something to go on from; a run that has none begins at its first batch."""
        return any(self.checkpoints.glob("*.safetensors"))

    def _is_of(self, config: TrainConfig) -> bool:
        try:
            return self.config() == config
        except CheckpointError:
            return False

    def model(self, config: TrainConfig) -> Model | None:
        """The fitted model that the run trains with, if any; the run keeps a copy, to be resumed from.

        Raises:
          ConfigError: if it can't be read.
          CheckpointError: if the copy can't be written.
        """
        if not config.model:
            return None
        gripper = load_gripper(config.gripper)
        if not self.model_path.exists():
            write_model(read_model_of(gripper, config.model), self.model_path)
        return read_model_of(gripper, self.model_path)

    @classmethod
    def open(cls, path: Path | str) -> RunDir:
        """Opens an existing run directory.

        Raises:
          CheckpointError: if it isn't one.
        """
        run = cls(path)
        if not run.path.is_dir():
            raise CheckpointError(f"{run.path}: no such run directory")
        if not run.config_path.is_file():
            raise CheckpointError(
                f"{run.path}: not a run directory (no config.yaml); a run is what forcegrasp train wrote"
            )
        return run

    @functools.cached_property
    def fingerprint(self) -> str:
        """Of the configuration as it was when first asked for: editing the file must not spoil a run at work."""
        self.config()  # says what is wrong with the file, if anything
        return fingerprint(plain_yaml.load(self.config_path))

    def config(self) -> TrainConfig:
        """The run's configuration.

        Raises:
          CheckpointError: if config.yaml can't be read or holds unknown or invalid options.
        """
        try:
            loaded = plain_yaml.load(self.config_path)
            if not isinstance(loaded, dict):  # text would be taken for more YAML
                raise ConfigError("no options in it")
            _refuse_interpolations(loaded)
            merged = OmegaConf.merge(OmegaConf.structured(TrainConfig), loaded)
            config = cast(TrainConfig, OmegaConf.to_object(merged))
            validate(config)
            gripper = load_gripper(config.gripper)
            model = read_model_of(gripper, self.model_path) if config.model and self.model_path.exists() else None
            config = complete(config, with_noise_of(gripper, model))
        except (OSError, OmegaConfBaseException, ConfigError, ValueError) as error:
            first_line = str(error).strip().splitlines()[0]
            raise CheckpointError(f"{self.config_path}: not a valid configuration ({first_line})") from error
        return config

    def save(
        self, frames: int, tensors: dict[str, Tensor], facts: dict[str, Any], keep: int, score: float | None = None
    ) -> Path:
        """Saves a checkpoint; keeps the newest ``keep``, and the best so far as ``best.safetensors``.

        Args:
          frames: trained so far.
          tensors, facts: the state of the training.
          keep: number of checkpoints.
          score: how good the policy is, the larger the better; None if it can't be compared.

        Raises:
          CheckpointError: if it can't be written.
        """
        path = self.checkpoints / f"frames_{frames:012d}.safetensors"
        facts = {**facts, "frames": frames, "config": self.fingerprint, "score": score}
        checkpoint.write(path, tensors, facts)
        if score is not None and score > self._best_score():
            checkpoint.write(self.best, tensors, facts)
        for old in (*self._files()[:-keep], *self.checkpoints.glob("*.part")):  # a kill may leave a part
            old.unlink()
        return path

    def _best_score(self) -> float:
        try:
            score = checkpoint.read(self.best)[1].get("score")
        except CheckpointError:
            score = None
        return score if isinstance(score, float) else -math.inf

    def load(self) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """Returns the newest checkpoint that can be read, or else the best.

        Raises:
          CheckpointError: if there is none, or it was made with another configuration.
        """
        first_error = None
        for path in (*reversed(self._files()), *self.checkpoints.glob(self.best.name)):
            try:
                tensors, facts = checkpoint.read(path)
            except CheckpointError as error:
                first_error = first_error or error
                continue
            return tensors, self._own(path, facts)
        raise first_error or CheckpointError(
            f"{self.checkpoints}: no checkpoint yet; train it with: forcegrasp train resume={self.path}"
        )

    def load_file(self, path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """Returns one checkpoint of this run.

        Raises:
          CheckpointError: if it can't be read, or was made with another configuration.
        """
        tensors, facts = checkpoint.read(path)
        return tensors, self._own(path, facts)

    def _own(self, path: Path, facts: dict[str, Any]) -> dict[str, Any]:
        if facts.get("config") != self.fingerprint:
            raise CheckpointError(
                f"{path}: was trained with another configuration than {self.config_path}; restore that file"
            )
        if not isinstance(facts.get("frames"), int):
            raise CheckpointError(f"{path}: not a checkpoint of a training; remove it to use an older one")
        return facts

    def _files(self) -> list[Path]:
        return sorted(self.checkpoints.glob("frames_*.safetensors"))

    def log_metrics(self, row: dict[str, float]) -> None:
        """Appends a row to metrics.csv; the first row decides the columns."""
        new = not self.metrics_path.exists()
        with open(self.metrics_path, "a", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, fieldnames=list(row))
            if new:
                writer.writeheader()
            writer.writerow(row)

    def drop_metrics_after(self, frames: int) -> None:
        """Keeps the whole rows up to a checkpoint, so that a resumed run logs nothing twice and mends a torn line."""
        if not self.metrics_path.exists():
            return
        with open(self.metrics_path, encoding="utf-8", newline="") as file:
            header, *lines = list(csv.reader(file.read().replace("\0", "").splitlines())) or [[]]
        kept = [line for line in lines if len(line) == len(header) and line[0].isdigit() and int(line[0]) <= frames]
        if not kept:  # the header may be torn, too; the next row writes it anew
            self.metrics_path.unlink()
            return
        text = io.StringIO(newline="")
        csv.writer(text).writerows([header, *kept])
        write_whole(self.metrics_path, text.getvalue().encode())


def _provenance(config: TrainConfig, overrides: list[str]) -> dict[str, Any]:
    return {
        "command": ["forcegrasp", "train", *overrides],
        "seed": config.seed,
        "config": fingerprint(dataclasses.asdict(config)),
        "git": _git_hash(),
        "python": sys.version.split()[0],
        "versions": {name: version(name) for name in _PACKAGES} | {"forcegrasp": version("forcegrasp")},
        "machine": {"system": platform.platform(), "processor": platform.machine(), "cores": os.cpu_count()},
    }


def _git_hash() -> str | None:
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
