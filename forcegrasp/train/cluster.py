"""Ray: joining or starting a cluster, room for the workers on it, and what its errors mean."""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from forcegrasp.config import TrainConfig
from forcegrasp.errors import ConfigError, ForcegraspError

#: How long to wait for cores that others hold, seconds.
PATIENCE_S = 60.0

#: No statistics sent, no warning of the next version's default.
QUIET = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",
}


def find_ray() -> Any:
    """Imports Ray.

    Raises:
      ConfigError: if it isn't installed.
    """
    try:
        return importlib.import_module("ray")
    except ImportError as error:
        raise ConfigError("collector.kind=ray needs an extra: pip install 'forcegrasp[ray]'") from error


def cores(config: TrainConfig) -> int:
    """Physics threads of each worker, which Ray keeps as many cores for; 0, every core, is one here."""
    return max(1, config.physics.threads)


def join(config: TrainConfig) -> None:
    """Joins the cluster at ``collector.address``, or starts one on this machine that ends with this process.

    Raises:
      ConfigError: if Ray isn't installed, or no cluster answers.
    """
    ray = find_ray()
    if ray.is_initialized():
        return
    for name, value in QUIET.items():
        os.environ.setdefault(name, value)
    # workers render nothing, and may have no OpenGL to import
    options: dict[str, Any] = {"runtime_env": {"env_vars": {"MUJOCO_GL": "disable"}}}
    local = config.collector.address == "local"
    if local:
        options |= {"num_cpus": config.collector.workers * cores(config), "include_dashboard": False}
    try:
        ray.init(config.collector.address, **options, log_to_driver=False, logging_level="ERROR")
    except (OSError, RuntimeError, ValueError) as error:
        if local:
            reason = " ".join(str(error).split())
            raise ConfigError(f"Ray could not be started here ({reason}); without it: collector=direct") from error
        raise ConfigError(
            "collector.address=auto: this machine is not part of a running Ray cluster; start one: ray start --head"
        ) from error


def reserve(config: TrainConfig) -> dict[str, Any]:
    """Waits until the cluster has room for all workers; returns what each asks of Ray.

    Raises:
      ConfigError: if there is no room.
    """
    ray, workers = find_ray(), config.collector.workers
    group = ray.util.placement_group([{"CPU": cores(config)}] * workers)
    if not group.wait(PATIENCE_S):
        ray.util.remove_placement_group(group)
        raise ConfigError(
            f"collector.workers={workers}: no room for so many of {cores(config)} core(s) each on the cluster, which"
            f" has {ray.cluster_resources().get('CPU', 0):g} cores; ask for fewer, or wait until others have finished"
        )
    strategy = ray.util.scheduling_strategies.PlacementGroupSchedulingStrategy(group)
    return {"num_cpus": cores(config), "scheduling_strategy": strategy}


@contextmanager
def translate_ray_errors() -> Iterator[None]:
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
