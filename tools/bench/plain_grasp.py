"""The learning problem in plain numpy behind gymnasium's interface: what somebody without TorchRL would write.

Our own view of gymnasium goes through tensordicts, which for a single grasp costs more than its physics. Peers that are
given this environment in its place are judged at their best.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from forcegrasp.config import TrainConfig
from forcegrasp.physics import GraspSampler, GraspSimulator, default_gripper
from forcegrasp.physics.completion import complete

if TYPE_CHECKING:  # it would bring torch
    from forcegrasp.curriculum.schedule import CurriculumValues


class PlainGrasp(gymnasium.Env[np.ndarray, np.ndarray]):
    """One grasp. Observation: the stacked o(t), ``(10 · frames,)``. Action: ``(2,)`` in [−1, 1].

    When an episode ends, ``info`` has its ``force_reward``, the sum over steps in the normalised form.

    Args:
      config: physics, grasp, sensors, observation, action and reward are read; its model must be empty and the
        observation have all parts.
      seed: of grasps and noise.
    """

    def __init__(self, config: TrainConfig, seed: int = 0) -> None:
        config = self.config = complete(config, default_gripper())
        self.simulator = GraspSimulator(1, config.physics.tier, threads=1)
        self.sampler = GraspSampler(config.grasp)
        self.rng = np.random.default_rng(seed)
        self.object_weight, self.speed_threshold_m = config.reward.object_weight, config.reward.speed_threshold_m
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (10 * config.observation.frames,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)

    def anneal(self, values: CurriculumValues) -> None:
        """Sets what the curriculum anneals; ranges hold from the next reset on."""
        self.object_weight, self.speed_threshold_m = values.object_weight, values.speed_threshold_m
        self.sampler.set_ranges(list(values.radius_m), list(values.offset_m))

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict]:
        if seed is not None:
            self.rng = np.random.default_rng(seed)
        self.simulator.reset(self.sampler(self.rng, np.arange(1)))
        self.goal = self.simulator.parameters.goal_force_n[0]
        self.had_contact, self.last_action, self.force_reward = np.zeros(2), np.zeros(2), 0.0
        self.frames = [self._observe()] * self.config.observation.frames
        return np.concatenate(self.frames, dtype=np.float32), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        simulator, weights = self.simulator, self.config.reward
        action = np.clip(action, -1.0, 1.0)
        simulator.step((action * self._bias() * self.config.action.max_delta_m)[None])
        error = np.abs(self.goal - simulator.force[0]).sum()
        normalised = 1 - np.tanh(error / self.goal)
        reward = weights.force_weight * (1 - np.tanh(error) if weights.form == "paper" else normalised)
        reward -= self.object_weight * (simulator.object_speed[0] > self.speed_threshold_m)
        reward -= weights.action_weight * np.abs(action - self.last_action).sum()
        self.last_action = action
        self.force_reward += float(normalised)
        self.frames = [*self.frames[1:], self._observe()]
        self.had_contact = self.frames[-1][8:]
        truncated = bool(simulator.steps[0] >= self.config.grasp.steps)
        info = {"force_reward": self.force_reward} if truncated else {}
        return np.concatenate(self.frames, dtype=np.float32), float(reward), False, truncated, info

    def _bias(self) -> np.ndarray | float:
        """φ of both fingers (paper, eq. 7)."""
        action, touched = self.config.action, self.had_contact.astype(bool)
        if not action.inductive_bias:
            return 1.0
        if touched.all():
            return np.maximum(action.bias_floor, 1 - np.abs(self.frames[-1][4:6]) / self.goal)
        return np.where(touched, action.bias_one_contact, 1.0)

    def _observe(self) -> np.ndarray:
        """o(t), ``(10,)``: position, force, force error, last action, had contact; the last is 0 at a reset."""
        sensors, noise = self.config.sensors, self.rng.standard_normal((2, 2))
        position = self.simulator.joint_position[0] + sensors.position_std_m * noise[0]
        force = self.simulator.force[0] + sensors.force_std_n * noise[1]
        touched = np.maximum(self.had_contact, force > sensors.contact_threshold_n) * (self.simulator.steps[0] > 0)
        return np.concatenate(
            [position * 2 / default_gripper().stroke - 1, force, self.goal - force, self.last_action, touched]
        )
