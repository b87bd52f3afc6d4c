"""The paper's learning problem, put together. The one place where the order of the transforms is written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from torchrl.envs import TransformedEnv
from torchrl.envs.transforms import CatFrames, CatTensors, Compose, ObservationNorm, Transform

from forcegrasp.config import (
    ActionConfig,
    GraspConfig,
    ObservationConfig,
    PhysicsConfig,
    RewardConfig,
    SensorConfig,
    validate,
)
from forcegrasp.effects.model_file import Model
from forcegrasp.effects.variation import read_tiago_model
from forcegrasp.env.grasp_env import GraspEnv
from forcegrasp.physics import GraspParameters
from forcegrasp.physics.sampling import OPEN_M
from forcegrasp.transforms import (
    ActionChangePenalty,
    ActionScale,
    ForceError,
    HadContact,
    InductiveBias,
    LastAction,
    ObservationNoise,
)

#: The tensordict entry behind each part of the paper's observation.
PART_KEYS = {
    "position": "scaled_position",
    "force": "sensed_force",
    "force_error": "force_error",
    "last_action": "last_action",
    "had_contact": "had_contact",
}


def build_env(
    n: int,
    *,
    physics: PhysicsConfig | None = None,
    grasp: GraspConfig | None = None,
    sensors: SensorConfig | None = None,
    observation: ObservationConfig | None = None,
    action: ActionConfig | None = None,
    reward: RewardConfig | None = None,
    sampler: Callable[[np.random.Generator, np.ndarray], GraspParameters] | None = None,
    model: Model | str | Path | None = None,
    seed: int = 0,
) -> TransformedEnv:
    """Returns ``n`` grasps with ``observation`` ``(n, 10 · frames)`` in and ``action`` ``(n, 2)`` in [−1, 1] out.

    Readings come first (noise), then what is computed from readings (contact, error), then memory, then the stacked
    observation; on the way back the action is denormalised, then biased. Parts left out use their defaults.
    A ``model`` fitted to measurements, or its file, brings its base parameters and effects, drawn anew for every grasp.

    Raises:
      ConfigError: if an option is out of its range, or the model can't be read or is of another gripper.
    """
    sensors, observation = sensors or SensorConfig(), observation or ObservationConfig()
    action, reward = action or ActionConfig(), reward or RewardConfig()
    for name, part in (("sensors", sensors), ("observation", observation), ("action", action)):
        validate(part, f"{name}.")
    known = None if model is None else read_tiago_model(model)
    grasps = GraspEnv(n, physics, grasp, reward, sampler, model=known)
    transforms: list[Transform] = [
        ObservationNoise(
            in_keys=["measured_position", "measured_force"],
            out_keys=["sensed_position", "sensed_force"],
            std=[sensors.position_std_m, sensors.force_std_n],
            device=grasps.device,
        ),
        HadContact(sensors.contact_threshold_n),
        ForceError(),
        LastAction(),
        ActionChangePenalty(reward.action_weight),
        # q from [0, 0.045] m to [-1, 1]
        ObservationNorm(loc=-1.0, scale=2 / OPEN_M, in_keys=["sensed_position"], out_keys=["scaled_position"]),
        CatTensors([PART_KEYS[part] for part in observation.parts], "observation", del_keys=False, sort=False),
        CatFrames(observation.frames, dim=-1, in_keys=["observation"], padding="same"),
    ]
    if action.inductive_bias:
        transforms.append(InductiveBias(action.bias_one_contact, action.bias_floor))
    transforms.append(ActionScale(action.max_delta_m))
    env = TransformedEnv(grasps, Compose(transforms))
    seed_env(env, seed)
    return env


def seed_env(env: TransformedEnv, seed: int) -> None:
    """Seeds the grasps and every noise transform, each with a stream of its own."""
    noises = [t for t in env.transform.modules() if isinstance(t, ObservationNoise)]
    grasp_seed, *noise_seeds = (int(s) for s in np.random.SeedSequence(seed).generate_state(1 + len(noises)))
    env.base_env.set_seed(grasp_seed)
    for noise, noise_seed in zip(noises, noise_seeds, strict=True):
        noise.set_seed(noise_seed)
