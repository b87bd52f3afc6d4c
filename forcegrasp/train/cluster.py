"""Ray: joining or starting a cluster, room for the workers on it, and what its errors mean."""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from forcegrasp.config import CollectorConfig
from forcegrasp.errors import ConfigError, ForcegraspError

#: How long to wait for cores that others hold, seconds.
PATIENCE_S = 60.0


def find_ray() -> Any:
    """Imports Ray.

    Raises:
      ConfigError: if it isn't installed.
    """
    try:
        return importlib.import_module("ray")
    except ImportError as error:
        raise ConfigError("collector.kind=ray needs an extra: pip install 'forcegrasp[ray]'") from error


def join(config: CollectorConfig, cores: int) -> None:
    """Joins the cluster at ``config.address``, or starts one on this machine that ends with this process.

    Args:
      config: where, and how many workers there will be.
      cores: cores of each worker.

    Raises:
      ConfigError: if Ray isn't installed, or no cluster answers.
    """
    ray = find_ray()
    if ray.is_initialized():
        return
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # it would send statistics, and say so
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")  # it would warn of its next version's default
    # workers render nothing, and may have no OpenGL to import
    options: dict[str, Any] = {"runtime_env": {"env_vars": {"MUJOCO_GL": "disable"}}}
    if config.address:
        options["address"] = config.address
    else:
        options |= {"address": "local", "num_cpus": config.workers * cores, "include_dashboard": False}
    try:
        ray.init(**options, log_to_driver=False, logging_level="ERROR")
    except (OSError, RuntimeError, ValueError) as error:
        where = f"no Ray cluster answers at collector.address={config.address}; start one: ray start --head"
        reason = " ".join(str(error).split())
        raise ConfigError(where if config.address else f"Ray could not be started here ({reason})") from error


def reserve(config: CollectorConfig, cores: int) -> dict[str, Any]:
    """Waits until the cluster has room for all workers; returns what each asks of Ray.

    Raises:
      ConfigError: if there is no room.
    """
    ray = find_ray()
    group = ray.util.placement_group([{"CPU": cores}] * config.workers)
    if not group.wait(PATIENCE_S):
        ray.util.remove_placement_group(group)
        raise ConfigError(
            f"collector.workers={config.workers}: the Ray cluster has no room for workers of {cores} core(s) each, of"
            f" its {ray.cluster_resources().get('CPU', 0):g} cores; ask for fewer, or wait until others have finished"
        )
    strategy = ray.util.scheduling_strategies.PlacementGroupSchedulingStrategy(group)
    return {"num_cpus": cores, "scheduling_strategy": strategy}


@contextmanager
def told_plainly() -> Iterator[None]:
    """Turns an error of a worker into what it would be in this process, and the loss of a worker into a line.

    Raises:
      ForcegraspError: if a worker is gone.
    """
    errors = importlib.import_module("ray.exceptions")
    try:
        yield
    except errors.RayTaskError as error:
        if isinstance(error.cause, ForcegraspError):
            raise error.cause from None
        raise
    except errors.RayError as error:
        raise ForcegraspError(
            f"a worker or the Ray cluster is gone ({type(error).__name__}); the last checkpoint can be resumed"
        ) from error
