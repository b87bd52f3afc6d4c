"""Who simulates the grasps of a batch: this process, or workers of a Ray cluster. Nothing else knows which."""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import functools
import sys
import time
import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, cast

import numpy as np
import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.collectors import Collector
from torchrl.collectors.distributed import RayCollector
from torchrl.envs import TransformedEnv
from torchrl.envs.transforms import Transform
from torchrl.modules import ProbabilisticActor

from forcegrasp.config import TrainConfig
from forcegrasp.curriculum import CurriculumHook, CurriculumValues, LinearSchedule
from forcegrasp.env import GraspEnv, build_env, with_memory
from forcegrasp.models.model_file import Model
from forcegrasp.models.robots import DrawnRobots
from forcegrasp.physics import load_gripper
from forcegrasp.train import cluster
from forcegrasp.train.episodes import can_collect, collect

#: How a checkpoint names the weights that the batch after it was begun with.
COLLECTING = "collecting."


class GraspCollector(Collector):
    """Endless batches of whole episodes, each from a fresh reset; curriculum and weights are set between batches.

    Batches don't share state, which is what makes a resumed run bit-identical.

    Args:
      create_env_fn: a training env, or what makes one.
      policy: what acts in it.
      schedule: the curriculum.
      frames_per_batch: grasps times steps of an episode.
      options: of the base class.
    """

    def __init__(self, create_env_fn: Any, policy: Any, *, schedule: LinearSchedule, **options: Any) -> None:
        plain: dict[str, Any] = {
            "reset_at_each_iter": True,
            "track_traj_ids": False,
            "auto_register_policy_transforms": False,  # it would add some twice
        }
        env = create_env_fn if isinstance(create_env_fn, TransformedEnv) else create_env_fn()
        super().__init__(with_memory(env, policy), policy, **plain | options)
        self.curriculum = CurriculumHook(schedule, self.env)

    def iterator(self) -> Iterator[TensorDictBase]:
        """Batches without end, by :mod:`forcegrasp.train.episodes` where it does the same as the base class."""
        actor = cast(ProbabilisticActor, self.policy)
        while can_collect(self.env, actor):
            yield collect(cast(TransformedEnv, self.env), actor, self.frames_per_batch)
        yield from super().iterator()

    def prepare(self, frames: int, weights: dict[str, Tensor]) -> CurriculumValues:
        """Applies the curriculum after so many frames, and the learner's weights."""
        cast(ProbabilisticActor, self.policy).load_state_dict(weights)
        return self.curriculum.apply(frames)

    def random_state(self) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """Every generator that episodes depend on, as tensors and as JSON."""
        noises = {f"env.{k}": v for k, v in self._transform.state_dict().items() if "_extra_state" in k}
        return noises | {"rng.torch": torch.get_rng_state()}, {"rng_grasps": self._rng.bit_generator.state}

    def set_random_state(self, tensors: dict[str, Tensor], facts: dict[str, Any]) -> None:
        """The inverse of :meth:`random_state`; more entries do no harm."""
        for key, value in tensors.items():
            if key.startswith("env."):
                name = key.removeprefix("env.").removesuffix("_extra_state").rstrip(".")
                self._transform.get_submodule(name).set_extra_state(value)
        self._rng.bit_generator.state = facts["rng_grasps"]
        torch.set_rng_state(tensors["rng.torch"])

    @property
    def _transform(self) -> Transform:
        return cast(TransformedEnv, self.env).transform

    @property
    def _rng(self) -> np.random.Generator:
        """What grasps are drawn with."""
        return cast(GraspEnv, cast(TransformedEnv, self.env).base_env).rng


def worker_seed(seed: int, worker: int) -> int:
    """Seed of a worker's streams; the first has the run's own, and trains as a direct collector does."""
    return int(np.random.SeedSequence([seed, worker]).generate_state(1, np.uint64)[0] >> 1) if worker else seed


def training_env(config: TrainConfig, model: Model | None = None, worker: int = 0) -> TransformedEnv:
    """A worker's share of the grasps, with seeds of its own."""
    threads = config.physics.threads if config.collector.kind == "direct" else cluster.cores(config)
    return build_env(
        config.algorithm.grasps // config.collector.workers,
        gripper=config.gripper,
        physics=dataclasses.replace(config.physics, threads=threads),
        grasp=config.grasp,
        sensors=config.sensors,
        observation=config.observation,
        action=config.action,
        reward=config.reward,
        model=model,
        robots=DrawnRobots(load_gripper(config.gripper)) if config.draws_robots else None,
        seed=worker_seed(config.seed, worker),
    )


def make_collector(
    config: TrainConfig,
    env: TransformedEnv,
    policy: ProbabilisticActor,
    schedule: LinearSchedule,
    frames_per_batch: int,
    model: Model | None = None,
) -> GraspCollector | RayCollector:
    """Returns a collector with this policy; ``map_fn`` calls a method of every worker's.

    Args:
      config: says who collects.
      env: the first worker's env, for collecting in this process.
      policy: this process's own; workers have copies.
      schedule: the curriculum.
      frames_per_batch: grasps times steps of an episode.
      model: what workers simulate.

    Raises:
      ConfigError: if Ray is not installed, does not answer or has no room.
    """
    if config.collector.kind == "direct":
        policy = copy.deepcopy(policy) if config.collector.ahead else policy
        return GraspCollector(env, policy, schedule=schedule, frames_per_batch=frames_per_batch)
    cluster.join(config)
    # weights travel with the curriculum, by Ray: torch's own way needs host names that every machine resolves
    warnings.filterwarnings("ignore", "RayCollector iteration started before weight synchronization")
    # as a direct collector would draw actions; the others are seeded
    states = [torch.get_rng_state()]
    for worker in range(1, config.collector.workers):
        states.append(torch.Generator().manual_seed(worker_seed(config.seed, worker)).get_state())
    with cluster.translate_ray_errors():
        return RayCollector(
            [functools.partial(_worker_env, config, model, worker, state) for worker, state in enumerate(states)],
            policy,
            collector_class=cast(Any, GraspCollector),  # annotated as a function of a batch, which it isn't
            collector_kwargs={"schedule": schedule},
            frames_per_batch=frames_per_batch,
            total_frames=sys.maxsize,  # it ends at once with -1
            reset_at_each_iter=True,
            sync=True,
            postproc=_as_one,
            remote_configs=cluster.reserve(config),
        )


def _worker_env(config: TrainConfig, model: Model | None, worker: int, torch_state: Tensor) -> TransformedEnv:
    """Called in the worker's process."""
    torch.set_num_threads(1)
    env = training_env(config, model, worker)
    torch.set_rng_state(torch_state)
    return env


def _as_one(batch: TensorDictBase) -> TensorDictBase:
    """Workers' episodes ``(workers, n, T)`` as ``(workers · n, T)``."""
    return batch.flatten(0, 1)


class NextBatch:
    """The batch that comes next. Within :func:`collecting` a thread collects it while the one before is learned from.

    Args:
      collector: who collects it.
      workers: how many that has.
      may_be_ahead: whether they collect ahead.

    Attributes:
      ahead: whether the thread does; outside it is off, lest it draws random numbers that nobody waits for.
      begun: every generator's state and the policy's weights as it was begun, as tensors and as JSON; None before.
    """

    def __init__(self, collector: GraspCollector | RayCollector, workers: int, may_be_ahead: bool) -> None:
        self.collector, self.workers, self.may_be_ahead = collector, workers, may_be_ahead
        self.ahead = False
        self.begun: tuple[dict[str, Tensor], dict[str, Any]] | None = None
        self._thread = ThreadPoolExecutor(1, initializer=torch.set_num_threads, initargs=(1,))
        self._batches: Iterator[TensorDictBase] | None = None

    def begin(self, frames: int, weights: dict[str, Tensor]) -> None:
        """Begins it, after so many frames; all workers act with these weights."""
        weights = {name: value.clone() for name, value in weights.items()}
        tensors, facts = random_states(self.collector)
        self.begun = tensors | {COLLECTING + name: value for name, value in weights.items()}, facts
        self._values = self.collector.map_fn("prepare", [(frames, weights)] * self.workers)[0]
        self._collected = self._thread.submit(self._collect) if self.ahead else None

    def get(self) -> tuple[TensorDictBase, CurriculumValues, float]:
        """Waits for it; returns it, the curriculum's values in it, and how many seconds it took to collect."""
        batch, seconds = self._collected.result() if self._collected else self._collect()
        self.begun = None
        return batch, self._values, seconds

    def end(self) -> None:
        """Waits until nothing collects."""
        self._thread.shutdown()

    def _collect(self) -> tuple[TensorDictBase, float]:
        started = time.perf_counter()
        self._batches = self._batches or iter(self.collector)
        return next(self._batches), time.perf_counter() - started


@contextlib.contextmanager
def collecting(batches: NextBatch) -> Iterator[None]:
    """Collects ahead, if that is asked for; ends the collector afterwards, and Ray with it.

    Raises:
      ForcegraspError: of a worker as of this process; and if a worker is lost.
    """
    batches.ahead = batches.may_be_ahead
    direct = isinstance(batches.collector, GraspCollector)
    try:
        with contextlib.nullcontext() if direct else cluster.translate_ray_errors():
            yield
    finally:
        batches.end()
        batches.collector.shutdown()
        if not direct:
            cluster.find_ray().shutdown()


def _prefix(worker: int) -> str:
    return f"worker_{worker}." if worker else ""


def random_states(collector: GraspCollector | RayCollector) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Every worker's generators, as tensors and as JSON; the first worker's are named as a direct collector's."""
    tensors, facts = {}, {}
    for worker, state in enumerate(collector.map_fn("random_state")):
        for part, own in zip((tensors, facts), state, strict=True):
            part |= {_prefix(worker) + key: value for key, value in own.items()}
    return tensors, facts


def set_random_states(
    collector: GraspCollector | RayCollector, workers: int, tensors: dict[str, Tensor], facts: dict[str, Any]
) -> None:
    """The inverse of :func:`random_states`."""

    def own(part: dict[str, Any], worker: int) -> dict[str, Any]:
        names = tuple(_prefix(worker) + name for name in ("env.", "rng.torch", "rng_grasps"))
        return {k.removeprefix(_prefix(worker)): v for k, v in part.items() if k.startswith(names)}

    states = [(own(tensors, worker), own(facts, worker)) for worker in range(workers)]
    collector.map_fn("set_random_state", states)
