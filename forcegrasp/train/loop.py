"""The training loop, from top to bottom: curriculum, collect, update, log, save."""

from __future__ import annotations

import time
from contextlib import contextmanager
from typing import Any

import torch
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.envs import TransformedEnv
from torchrl.modules import ProbabilisticActor

from forcegrasp.config import TrainConfig
from forcegrasp.curriculum import CurriculumValues, LinearSchedule
from forcegrasp.env.episodes import summarise
from forcegrasp.errors import CheckpointError
from forcegrasp.models.model_file import Model
from forcegrasp.models.variation import with_noise_of
from forcegrasp.physics import load_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.algorithms import algorithm_of
from forcegrasp.train.algorithms.base import part_of
from forcegrasp.train.collector import (
    COLLECTING,
    NextBatch,
    collecting,
    make_collector,
    random_states,
    set_random_states,
    training_env,
)
from forcegrasp.train.logging import TrainingLog
from forcegrasp.train.stop import stop_signals
from forcegrasp.train.warm_start import read_start


class Trainer:
    """Everything that a training consists of; all of its state can be saved and restored.

    Args:
      config: the whole configuration.
      model: what ``config.model`` names; nominal gripper by default.

    Raises:
      ConfigError: if an option is out of its range.
    """

    def __init__(self, config: TrainConfig, model: Model | None = None) -> None:
        self.config = config
        self.frames = self.batches = 0
        torch.set_num_threads(1)  # the physics needs the cores
        torch.manual_seed(config.seed)
        self.gripper = load_gripper(config.gripper)
        config = self.config = complete(config, with_noise_of(self.gripper, model))
        self.env: TransformedEnv = training_env(config, model)
        self.algorithm = algorithm_of(config)(config, self.env, self.gripper)
        total, frames = self.algorithm.total_frames, self.algorithm.frames_per_batch
        self.schedule = LinearSchedule(config.curriculum, config.grasp, config.reward, total)
        self.collector = make_collector(config, self.env, self.policy, self.schedule, frames, model)
        ahead = config.collector.ahead and not self.algorithm.DRAWS
        self.next_batch = NextBatch(self.collector, config.collector.workers, ahead)
        self._begin_with: dict[str, Tensor] = {}

    @property
    def policy(self) -> ProbabilisticActor:
        """What the algorithm has learned so far."""
        return self.algorithm.policy

    def collect(self) -> tuple[TensorDictBase, CurriculumValues, float]:
        """The next batch, the curriculum's values in it, and how many seconds it took to collect.

        Within ``collecting(trainer.next_batch)``, and with ``collector.ahead``, the batch after it is begun, by the
        policy as it is now.
        """
        if self.next_batch.begun is None:
            self._begin(self.frames)
        collected = self.next_batch.get()
        after = self.frames + collected[0].numel()
        if self.next_batch.ahead and after < self.algorithm.total_frames:
            self._begin(after)
        return collected

    def _begin(self, frames: int) -> None:
        """Begins the next batch, after so many frames; one that a checkpoint saw begun, with the weights it had."""
        self.next_batch.begin(frames, self._begin_with or self.policy.state_dict())
        self._begin_with = {}

    def state(self) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """All that changes while training, as tensors and as JSON: a batch that was begun will be begun again."""
        generators, facts = self.next_batch.begun or random_states(self.collector)
        tensors = self.algorithm.state_dict() | generators
        facts = facts | {"batches": self.batches, "curriculum": self.schedule(self.frames).scalars()}
        return {k: v.detach().cpu().contiguous().clone() for k, v in tensors.items()}, facts

    def restore(self, tensors: dict[str, Tensor], facts: dict[str, Any]) -> None:
        """The inverse of :meth:`state`.

        Raises:
          CheckpointError: if this is not the state of such a training.
        """
        try:
            self._restore(tensors, facts)
        except (AttributeError, KeyError, IndexError, RuntimeError, TypeError, ValueError) as error:
            raise CheckpointError("the checkpoint does not hold the state of such a training; start anew") from error

    def _restore(self, tensors: dict[str, Tensor], facts: dict[str, Any]) -> None:
        self.algorithm.load_state_dict(tensors)
        self.frames, self.batches = int(facts["frames"]), int(facts["batches"])
        self._begin_with = part_of(tensors, COLLECTING)
        set_random_states(self.collector, self.config.collector.workers, tensors, facts)


def train(config: TrainConfig, run: RunDir, resume: bool = False) -> bool:
    """Trains until the algorithm has had its frames; saves into the run directory. Returns False if interrupted.

    Ctrl-C, SIGTERM, SIGHUP or SIGUSR1 end it after the batch at work, with a checkpoint; a further Ctrl-C at once.

    Raises:
      ConfigError, CheckpointError, PhysicsError: with what to do about it.
    """
    with run.only_writer():
        return _train(config, run, resume)


def _train(config: TrainConfig, run: RunDir, resume: bool) -> bool:
    trainer = Trainer(config, run.model(config))
    config, algorithm, period_s = trainer.config, trainer.algorithm, trainer.gripper.period_s
    total = algorithm.total_frames
    if resume and run.has_checkpoint:
        trainer.restore(*run.load())
    elif config.start:
        trainer.algorithm.begin_with(read_start(config))
    batch = None
    with (
        collecting(trainer.next_batch),
        TrainingLog(run, config, trainer.frames) as log,
        stop_signals() as stop,
        _progress(total, trainer.frames, config.grasp.steps) as progress,
    ):
        last = trainer.frames >= total
        while not last:
            started = time.perf_counter()
            batch, values, collect_s = trainer.collect()
            collected = time.perf_counter()
            summary = summarise(batch, config.sensors, period_s)
            metrics = {name: float(value.mean()) for name, value in summary.items()}
            algorithm.set_progress(trainer.frames / total)
            learning = algorithm.update(batch)
            ended = time.perf_counter()

            whole_task = trainer.frames >= trainer.schedule.end_frames  # before, the batch was easier
            trainer.frames += batch.numel()
            trainer.batches += 1
            terms = batch.get(("next", "reward_terms"))
            groups = {
                "episode": {"return": float(batch.get(("next", "reward")).sum((1, 2)).mean()), **metrics},
                "reward": {name: float(terms[name].mean()) for name in sorted(terms.keys())},
                config.algorithm.name: learning,
                "curriculum": values.scalars(),
                "speed": {
                    "frames_per_s": batch.numel() / (ended - started),
                    "collect_frames_per_s": batch.numel() / collect_s,
                    "update_share": (ended - collected) / (ended - started),
                },
            }
            log.batch(trainer.batches, trainer.frames, groups, batch)
            every = config.log
            if every.video_every and trainer.batches % every.video_every == 0:
                log.video(batch[0], trainer.frames)
            last = trainer.frames >= total or bool(stop)
            if last or trainer.batches % every.checkpoint_every == 0:
                score = metrics["force_reward_normalised"] if whole_task else None
                run.save(trainer.frames, *trainer.state(), keep=every.keep, score=score)
            progress(trainer.frames, metrics)
        if batch is not None and not stop:
            if config.log.figures_every:
                log.traces(batch[:6], trainer.frames)
            if config.log.video_every:
                log.video(batch[0], trainer.frames)
    return trainer.frames >= total


@contextmanager
def _progress(total: int, done: int, steps: int):
    """Yields a function that shows progress: ``(frames, metrics of the episodes)``."""
    columns = [
        BarColumn(bar_width=16),
        TextColumn("{task.percentage:3.0f} % of {task.total:,} frames"),
        TextColumn("{task.fields[reached]}"),
        TimeRemainingColumn(),
    ]
    with Progress(*columns) as bar:
        task = bar.add_task("training", total=total, completed=done, reached="")

        def show(frames: int, metrics: dict[str, float]) -> None:
            reward, moved = metrics["force_reward_normalised"], metrics["displacement_until_grasped_mm"]
            reached = f"force reward {reward:.0f}/{steps} moved {moved:.2f} mm"
            bar.update(task, completed=min(frames, total), reached=reached)

        yield show
