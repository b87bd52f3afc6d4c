"""The paper's learning problem, put together. The one place where the order of the transforms is written."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from torchrl.envs import TransformedEnv
from torchrl.envs.transforms import CatFrames, CatTensors, Compose, ObservationNorm, Transform

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.config import (
    ActionConfig,
    GraspConfig,
    ObservationConfig,
    PhysicsConfig,
    RewardConfig,
    SensorConfig,
    validate,
)
from forcegrasp.env.grasp_env import READING_VARIATION, GraspEnv
from forcegrasp.errors import ConfigError
from forcegrasp.models.model_file import Model
from forcegrasp.models.robots import DrawnRobots, FixedRobots
from forcegrasp.models.variation import read_model_of, with_noise_of
from forcegrasp.observation import PARTS
from forcegrasp.physics import GraspParameters, Gripper, load_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.physics.gripper import NO_FORCES
from forcegrasp.physics.sensors import rounding_steps
from forcegrasp.transforms import (
    ActionChangePenalty,
    ActionScale,
    ForceError,
    HadContact,
    InductiveBias,
    LastAction,
    ObservationNoise,
    TouchForce,
)


def build_env(
    n: int,
    *,
    gripper: Gripper | str = DEFAULT_GRIPPER,
    physics: PhysicsConfig | None = None,
    grasp: GraspConfig | None = None,
    sensors: SensorConfig | None = None,
    observation: ObservationConfig | None = None,
    action: ActionConfig | None = None,
    reward: RewardConfig | None = None,
    sampler: Callable[[np.random.Generator, np.ndarray], GraspParameters] | None = None,
    model: Model | str | Path | None = None,
    robots: DrawnRobots | FixedRobots | None = None,
    seed: int = 0,
) -> TransformedEnv:
    """Returns ``n`` grasps with ``observation`` ``(n, size · frames)`` in, ``action`` ``(n, motors)`` in [−1, 1] out.

    Readings come first (noise, then rounding), then what is computed from readings (contact, error), then memory, then
    the stacked observation; on the way back the action is denormalised, then biased. Parts left out use their defaults,
    and options left out the gripper's (by name, or the path of its description). A ``model`` fitted to measurements, or
    its file, brings its base parameters and effects, drawn anew for every grasp, and the noise of its readings; or
    ``robots`` bring them.

    Raises:
      ConfigError: if an option is out of its range, the gripper reads no forces, or the model can't be read or is of
        another gripper.
    """
    if not isinstance(gripper, Gripper):
        gripper = load_gripper(gripper)
    if not gripper.forces:
        raise ConfigError(f"gripper={gripper.name}: {NO_FORCES}")
    known = None if model is None else read_model_of(gripper, model)
    sensors = complete(sensors or SensorConfig(), with_noise_of(gripper, known))
    observation = observation or ObservationConfig()
    action, reward = complete(action or ActionConfig(), gripper), reward or RewardConfig()
    for name, part in (("sensors", sensors), ("observation", observation), ("action", action)):
        validate(part, f"{name}.")
    parts = [PARTS[name] for name in observation.parts]
    grasps = GraspEnv(n, physics, grasp, reward, sampler, model=known, gripper=gripper, robots=robots)
    transforms: list[Transform] = [
        ObservationNoise(
            in_keys=["measured_position", "measured_force"],
            out_keys=["sensed_position", "sensed_force"],
            std=[sensors.position_std_m, sensors.force_std_n],
            device=grasps.device,
            step=rounding_steps((found.effect, found.values) for found in known.effects).tolist() if known else None,
            per_row=READING_VARIATION if robots else None,
        ),
        HadContact(sensors.contact_threshold_n, stall=gripper.stall),
        ForceError(),
        LastAction(),
        ActionChangePenalty(reward.action_weight),
        # q from [0, stroke] to [-1, 1]
        ObservationNorm(loc=-1.0, scale=2 / gripper.stroke, in_keys=["sensed_position"], out_keys=["scaled_position"]),
        *(_transform(module, gripper, sensors) for module in dict.fromkeys(p.transform for p in parts) if module),
        CatTensors([part.entry or part.name for part in parts], "observation", del_keys=False, sort=False),
        CatFrames(observation.frames, dim=-1, in_keys=["observation"], padding="same"),
    ]
    if action.inductive_bias:
        gentle_n = action.gentle_touch * gripper.training.largest_force_n
        if gentle_n:
            transforms.append(TouchForce())
        transforms.append(InductiveBias(action.bias_one_contact, action.bias_floor, gentle_n))
    transforms.append(ActionScale(action.max_delta_m))
    env = TransformedEnv(grasps, Compose(transforms))
    seed_env(env, seed)
    return env


def _transform(module: str, gripper: Gripper, sensors: SensorConfig) -> Transform:
    """What writes a part of the observation that is not always there, see :mod:`forcegrasp.observation`."""
    return importlib.import_module(f"forcegrasp.transforms.{module}").make(gripper, sensors)


def with_memory(env: TransformedEnv, policy: Any) -> TransformedEnv:
    """The environment, which now carries what a policy remembers from step to step, if it has a memory."""
    make_primer = getattr(policy, "make_tensordict_primer", None)
    return env.append_transform(make_primer()) if make_primer else env


def seed_env(env: TransformedEnv, seed: int) -> None:
    """Seeds the grasps and every noise transform, each with a stream of its own."""
    noises = [t for t in env.transform.modules() if isinstance(t, ObservationNoise)]
    grasp_seed, *noise_seeds = (int(s) for s in np.random.SeedSequence(seed).generate_state(1 + len(noises)))
    env.base_env.set_seed(grasp_seed)
    for noise, noise_seed in zip(noises, noise_seeds, strict=True):
        noise.set_seed(noise_seed)
