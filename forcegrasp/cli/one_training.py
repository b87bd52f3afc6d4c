"""One training: checked before anything is written, begun, or gone on with."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

from forcegrasp.cli.options import compose_run
from forcegrasp.errors import ConfigError

if TYPE_CHECKING:
    from forcegrasp.config import TrainConfig
    from forcegrasp.physics import Gripper
    from forcegrasp.runs.run_dir import RunDir

#: Why a run of a sweep failed, in its folder.
FAILURE = "failed.txt"
#: Exit status after Ctrl-C, as shells have it.
INTERRUPTED = 130


def train_one(overrides: list[str]) -> int:
    """Composes, checks and trains a single run; returns the exit status."""
    config, run_dir = compose_run("train", overrides)
    if preset := next((o for o in overrides if o.startswith("sweep=") and o != "sweep=none"), ""):
        raise ConfigError(f"{preset} is several runs: add -m to run one after another")
    config = check(config)
    join_cluster(config)
    return begin(config, Path(run_dir), overrides)


def complete_for_gripper(config: TrainConfig) -> tuple[TrainConfig, Gripper]:
    """The configuration with what it leaves to the gripper's description and the model's noise, and the gripper."""
    from forcegrasp.models.variation import read_model_of, with_noise_of
    from forcegrasp.physics import load_gripper
    from forcegrasp.physics.completion import complete

    gripper = load_gripper(config.gripper)
    model = read_model_of(gripper, config.model) if config.model else None
    return dataclasses.replace(complete(config, with_noise_of(gripper, model)), gripper=gripper.name_or_path), gripper


def check(config: TrainConfig) -> TrainConfig:
    """Refuses what can't be trained before anything is written; returns the whole configuration."""
    from forcegrasp.config import validate
    from forcegrasp.gpu import check_engine
    from forcegrasp.gpu.installation import check_gripper_for_warp
    from forcegrasp.physics import GraspSampler
    from forcegrasp.physics.gripper import NO_FORCES

    check_engine(config.physics)
    config, gripper = complete_for_gripper(config)
    validate(config)
    GraspSampler(config.grasp, gripper).set_ranges(config.curriculum.radius_m, config.curriculum.offset_m)
    if not gripper.forces:
        raise ConfigError(f"gripper={config.gripper}: {NO_FORCES}")
    if config.physics.engine == "warp":
        check_gripper_for_warp(gripper)
    if config.collector.kind == "ray":
        from forcegrasp.train.cluster import find_ray

        find_ray()
    if config.start:
        from forcegrasp.train.warm_start import read_start

        read_start(config)
    return config


def join_cluster(config: TrainConfig) -> None:
    """Refuses a Ray cluster that does not answer before anything is written."""
    if config.collector.kind == "ray":
        from forcegrasp.train.cluster import join

        join(config)


def begin_or_resume(path: Path, config: TrainConfig, overrides: list[str]) -> int:
    """Goes on with this very run if a scheduler started its job anew, or if the sweep was typed again."""
    from forcegrasp.runs.run_dir import RunDir

    config, _ = complete_for_gripper(config)
    join_cluster(config)
    if RunDir(path).has_checkpoint and RunDir.open(path).config() == config:
        return resume(path)
    return begin(config, path, overrides)


def resume(path: Path) -> int:
    """Goes on with a run; returns the exit status."""
    from forcegrasp.runs.run_dir import RunDir

    run = RunDir.open(path)
    config = run.config()
    (path / FAILURE).unlink(missing_ok=True)  # told when it failed; it gets another chance
    if run.has_checkpoint and run.load()[1]["frames"] >= config.algorithm.total_frames:
        print(f"{path}: already trained to the end ({config.algorithm.total_frames:,} frames)")
        return 0
    return _train(config, run, resume=True)


def begin(config: TrainConfig, path: Path, overrides: list[str]) -> int:
    """Trains into a new run directory; returns the exit status."""
    from forcegrasp.runs.run_dir import RunDir

    run = RunDir.create(path, config, overrides)
    print(f"run directory: {run.path}")
    return _train(config, run, resume=False)


def _train(config: TrainConfig, run: RunDir, resume: bool) -> int:
    try:
        from forcegrasp.train.board import evaluate_command
        from forcegrasp.train.loop import train

        done = train(config, run, resume)
    except KeyboardInterrupt:  # before the first batch, or typed twice
        print(f"interrupted; go on with: forcegrasp train resume={run.path}")
        return INTERRUPTED
    if done:
        print(f"trained. Compare it with the hand-written one: {evaluate_command(run, config)}")
        return 0
    print(f"stopped and saved; go on with: forcegrasp train resume={run.path}")
    return INTERRUPTED
