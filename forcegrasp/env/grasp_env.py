"""The grasp as a TorchRL environment: clean state in SI units; noise, memory and scaling are transforms."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import torch
from jaxtyping import Float, Shaped
from tensordict import TensorDict, TensorDictBase
from tensordict.utils import NestedKey
from torch import Tensor
from torchrl.data import Bounded, Categorical, Composite, Unbounded
from torchrl.envs import EnvBase

from forcegrasp.config import GraspConfig, PhysicsConfig, RewardConfig, check_no_effects, validate
from forcegrasp.env.reward import force_reward, normalised_force_reward, object_penalty, overshoot_penalty
from forcegrasp.errors import ConfigError
from forcegrasp.gpu.simulator import WarpGraspSimulator
from forcegrasp.models.model_file import Model
from forcegrasp.models.robots import DrawnRobots, FixedRobots
from forcegrasp.models.variation import ModelVariation
from forcegrasp.physics import GraspParameters, GraspSampler, GraspSimulator, Gripper, default_gripper
from forcegrasp.physics.completion import complete

#: The entries a step writes beside reward and done: how many numbers (or of what), and their meaning.
OBSERVATIONS = {
    "joint_position": ("motors", "positions of the motors (left, right, or the one), m or rad; 0 is closed"),
    "measured_position": ("motors", "what the encoders say, before noise, m or rad"),
    "commanded_position": ("motors", "q_des held during the step, m or rad"),
    "force": (2, "true fingertip forces (left, right), newtons"),
    "measured_force": ("channels", "what the force readings say, before noise, newtons"),
    "goal_force": (1, "goal force of each finger, newtons"),
    "object_position": (1, "object position along the grasp axis, metres"),
    "object_speed": (1, "|change of object position|, metres per control step"),
    "grasp_parameters": (5, "kappa, b2, radius_m, offset_m, goal_force_n of the grasp"),
    ("reward_terms", "force_paper"): (1, "r_force as printed in the paper, unweighted"),
    ("reward_terms", "force_normalised"): (1, "r_force divided by the goal force, unweighted"),
    ("reward_terms", "object"): (1, "r_obj, unweighted"),
    ("reward_terms", "overshoot"): (1, "r_over, unweighted"),
}
#: Tensors by key; of nested ones by their path.
State = dict[NestedKey, Tensor]
#: The terms of the reward that follow from forces.
FORCE_TERMS = ("force_paper", "force_normalised", "overshoot")
#: The entry that robots add: factors of the noise of positions and forces, and steps that they are rounded to.
READING_VARIATION = "reading_variation"


class GraspEnv(EnvBase):
    """``n`` grasps at once. Action: ``joint_delta``, u = Δq_des, m or rad, ``(n, motors)``; see ``OBSERVATIONS``.

    The reward is α₁ r_force + α₂ r_obj of paper eq. 11 and a weight times r_over, from the true state; r_act needs the
    policy's own actions and is added by :class:`~forcegrasp.transforms.ActionChangePenalty`. An episode is truncated,
    never terminated.

    Args:
      n: number of grasps, the batch size.
      physics: engine, device, tier and threads. On device ``cuda`` all tensors are there, and stay there.
      grasp: ranges the grasps are drawn from.
      reward: form, weights and velocity threshold.
      sampler: what to draw grasps with instead, ``(rng, ids) -> GraspParameters``.
      seed: seed of the sampler's generator.
      model: a fitted model to draw grippers from, with the effects found in it; nominal by default. It overrides
        the range of b2.
      gripper: what grasps; the paper's by default.
      robots: robots of that gripper to grasp with, instead of a model's; they, too, override the range of b2.

    Raises:
      ConfigError: if an option is out of its range.
      PhysicsError: from a step, if a grasp diverged.
    """

    def __init__(
        self,
        n: int = 1,
        physics: PhysicsConfig | None = None,
        grasp: GraspConfig | None = None,
        reward: RewardConfig | None = None,
        sampler: Callable[[np.random.Generator, np.ndarray], GraspParameters] | None = None,
        seed: int = 0,
        model: Model | None = None,
        gripper: Gripper | None = None,
        robots: DrawnRobots | FixedRobots | None = None,
    ) -> None:
        gripper = gripper or default_gripper()
        physics, grasp = physics or PhysicsConfig(), complete(grasp or GraspConfig(), gripper)
        reward = dataclasses.replace(reward or RewardConfig())
        for name, part in (("physics", physics), ("grasp", grasp), ("reward", reward)):
            validate(part, f"{name}.")
        simulator = _simulator(gripper, n, physics, model, robots)  # first: it says what is wrong with the device
        super().__init__(device=physics.device, batch_size=torch.Size([n]))
        self.gripper, self.simulator, self.reward_config = gripper, simulator, reward
        self.robots = robots
        self.sampler = sampler or GraspSampler(grasp, gripper)
        self.episode_steps = grasp.steps
        self._drawn = self._column(simulator.parameters.as_array())
        self.set_seed(seed)
        self._make_specs(n)

    def _make_specs(self, n: int) -> None:
        def unbounded(size: int) -> Unbounded:
            return Unbounded(shape=torch.Size([n, size]), dtype=torch.float32, device=self.device)

        sizes = {"motors": len(self.gripper.motors), "channels": len(self.gripper.forces)}
        stroke, shape = self.gripper.stroke, torch.Size([n, sizes["motors"]])
        delta = Bounded(-stroke, stroke, shape=shape, dtype=torch.float32, device=self.device)
        self.action_spec = Composite(joint_delta=delta, shape=(n,), device=self.device)
        self.observation_spec = Composite(shape=(n,), device=self.device)
        for key, (size, _) in OBSERVATIONS.items():
            self.observation_spec[key] = unbounded(size if isinstance(size, int) else sizes[size])
        if self.robots:
            self.observation_spec[READING_VARIATION] = unbounded(4)
        self.observation_spec["reward_terms"].shape = torch.Size([n])
        self.reward_spec = unbounded(1)
        flag = Categorical(2, shape=torch.Size([n, 1]), dtype=torch.bool, device=self.device)
        flags = {name: flag.clone() for name in ("done", "terminated", "truncated")}
        self.full_done_spec = Composite(flags, shape=(n,), device=self.device)

    def _set_seed(self, seed: int | None) -> None:
        self.rng = np.random.default_rng(seed)

    def _reset(self, tensordict: TensorDictBase | None = None, **kwargs) -> TensorDictBase:
        mask = None if tensordict is None else tensordict.get("_reset", None)
        ids = np.arange(self.simulator.n) if mask is None else np.flatnonzero(mask.cpu().numpy().reshape(-1))
        self.simulator.reset(self.sampler(self.rng, ids), ids, self.rng)
        self._drawn = self._column(self.simulator.parameters.as_array())
        return TensorDict(self._state(), batch_size=self.batch_size)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        return TensorDict(self.advance(tensordict.get("joint_delta")), batch_size=self.batch_size)

    def advance(self, delta: Float[Tensor, "n motors"]) -> State:
        """Takes a step; returns all entries that it leads to, by key, nested ones by their path."""
        if isinstance(self.simulator, WarpGraspSimulator):
            self.simulator.step(delta)
        else:
            self.simulator.step(delta.numpy().astype(np.float64))
        state, config = self._state(), self.reward_config
        if config.forces == "actual":
            judged = {name: state["reward_terms", name] for name in FORCE_TERMS}
        else:
            judged = self._force_terms(state["measured_force"], state["goal_force"])
        form = judged["force_paper" if config.form == "paper" else "force_normalised"]
        reward = config.force_weight * form + config.object_weight * state["reward_terms", "object"]
        state["reward"] = reward + config.overshoot_weight * judged["overshoot"]
        return state

    def _column(self, values: Shaped[np.ndarray | Tensor, "{self.simulator.n} ..."]) -> Float[Tensor, "n k"]:
        """A simulator's values ``(n,)`` or ``(n, k)`` as a float32 tensor ``(n, k)`` on the env's device."""
        return torch.as_tensor(values, dtype=torch.float32, device=self.device).reshape(self.simulator.n, -1)

    def _force_terms(self, force: Tensor, goal: Tensor) -> dict[str, Tensor]:
        """The reward's terms that follow from forces, newtons, ``(n, 2)`` or ``(n, channels)``; unweighted."""
        error = goal - force
        return {
            "force_paper": force_reward(error),
            "force_normalised": normalised_force_reward(error, goal),
            "overshoot": overshoot_penalty(force, goal, self.reward_config.overshoot_margin),
        }

    def _state(self) -> State:
        simulator, column, parameters = self.simulator, self._column, self._drawn.clone()
        force, goal, speed = column(simulator.force), parameters[:, -1:], column(simulator.object_speed)
        terms = self._force_terms(force, goal)
        terms["object"] = object_penalty(speed, self.reward_config.speed_threshold_m)
        state: State = {
            "joint_position": column(simulator.joint_position),
            "measured_position": column(simulator.measured_position),
            "commanded_position": column(simulator.commanded_position),
            "force": force,
            "measured_force": column(simulator.measured_force),
            "goal_force": goal.clone(),
            "object_position": column(simulator.object_position),
            "object_speed": speed,
            "grasp_parameters": parameters,
            **{("reward_terms", name): term for name, term in terms.items()},
            **self._done(),
        }
        if self.robots:
            state[READING_VARIATION] = column(self.robots.readings)
        return state

    def _done(self) -> dict[str, Tensor]:
        truncated = torch.as_tensor(self.simulator.steps >= self.episode_steps, device=self.device).unsqueeze(-1)
        return {"done": truncated, "truncated": truncated.clone(), "terminated": torch.zeros_like(truncated)}


def _simulator(
    gripper: Gripper,
    n: int,
    physics: PhysicsConfig,
    model: Model | None,
    robots: DrawnRobots | FixedRobots | None,
) -> GraspSimulator | WarpGraspSimulator:
    check_no_effects(model or robots, physics, "robots" if robots else "model")
    if model is not None and robots is not None:
        raise ConfigError("robots: a model is given, too; leave one of them out")
    if physics.engine == "warp":
        return WarpGraspSimulator(n, physics.tier, physics.device, gripper)
    variation = robots if model is None else ModelVariation(model)
    return GraspSimulator(n, physics.tier, physics.threads, variation, gripper)
