"""A run directory: resolved config, provenance, metrics and checkpoints, enough to understand and resume a run."""

from __future__ import annotations

import dataclasses
import functools
import json
import math
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import yaml
from torch import Tensor

from forcegrasp.config import TrainConfig
from forcegrasp.errors import CheckpointError
from forcegrasp.files.whole_file import write_whole
from forcegrasp.models.model_file import Model, write_model
from forcegrasp.models.variation import read_model_of
from forcegrasp.physics import load_gripper
from forcegrasp.runs import checkpoint, metrics_file
from forcegrasp.runs.config_file import MODEL, fingerprint, read_config, read_options
from forcegrasp.runs.history import flat
from forcegrasp.runs.lock import only_writer
from forcegrasp.runs.provenance import provenance

#: Of so many options that differ each is told; more are another training altogether.
_FEW = 3


class RunDir:
    """The files of one training run."""

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self.config_path = self.path / "config.yaml"
        self.metrics_path = self.path / "metrics.csv"
        self.model_path = self.path / MODEL
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
                        f"{run.path}: already holds a run{run._other_options(config)};"
                        f" continue it with resume={run.path}, or name another"
                    )
                for folder in (run.checkpoints, run.tensorboard, run.figures):
                    folder.mkdir(parents=True, exist_ok=True)
                run.model_path.unlink(missing_ok=True)  # of a run that is begun again: its source may have changed
                facts = provenance(config, overrides)
                run.fingerprint = facts["config"]
                write_whole(run.path / "run.json", (json.dumps(facts, indent=2) + "\n").encode())
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

    def _other_options(self, config: TrainConfig) -> str:
        """In words, which options of the run that is here are not those of a configuration."""
        try:
            here = flat(dataclasses.asdict(self.config()))
        except CheckpointError:
            return ""
        names = [name for name, value in flat(dataclasses.asdict(config)).items() if here.get(name) != value]
        return f" with another {' and '.join(names)}" if 0 < len(names) <= _FEW else ""

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
        """Of the configuration as created, or when first asked for: editing the file must not spoil a run at work."""
        return fingerprint(read_options(self.config_path))

    def config(self) -> TrainConfig:
        """The run's configuration.

        Raises:
          CheckpointError: if config.yaml can't be read or holds unknown or invalid options.
        """
        return read_config(self.config_path)

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
        """Appends a row to metrics.csv, see :mod:`~forcegrasp.runs.metrics_file`."""
        metrics_file.append_row(self.metrics_path, row)

    def drop_metrics_after(self, frames: int) -> None:
        """Keeps the rows of metrics.csv up to a checkpoint."""
        metrics_file.drop_rows_after(self.metrics_path, frames)
