"""Options of learning algorithms: those that every one has, and each one's own. The only home of their defaults."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from forcegrasp.config.option import option


@dataclass
class AlgorithmConfig:
    """What every algorithm has: how long it trains, with how many grasps at once, and the policy's network."""

    name: ClassVar[str]  #: of its section, and of its columns in metrics.csv

    total_frames: int = option(
        4_500_000, "control steps to train for, over all grasps", source="authors' code", low=1, high=10**12
    )
    grasps: int = option(256, "grasps simulated at once; a batch is one episode of each", low=1, high=100_000)
    hidden: list[int] = option(
        [50, 50], "width of each hidden layer, policy and value alike", source="authors' code", low=1, high=10_000
    )
    log_std: float = option(-0.5, "logarithm of the policy's initial standard deviation", low=-10, high=2)
    initial_action: float = option(
        -0.5, "the policy's mean action at the start: closing, lest training never meets the object", low=-1, high=1
    )
    mirrored: bool = option(
        True,
        "average the policy with its mirror image where the gripper is its own, so that it treats both fingers alike",
    )
    squeeze_together: bool = option(
        False,
        "all motors get the mean of their actions once every reading has shown contact, as with force_pi",
        source="Lach et al. 2022",
    )


@dataclass
class PPOConfig(AlgorithmConfig):
    """Proximal policy optimisation (Schulman et al. 2017)."""

    name: ClassVar[str] = "ppo"

    memory: int = option(
        0, "units of the policy's memory, a GRU over the whole grasp (recurrent PPO); 0: no memory", low=0, high=10_000
    )
    epochs: int = option(4, "passes over each batch; the authors had 10", low=1, high=1000)
    minibatch: int = option(
        512, "frames per gradient step; the authors had 64. With a memory, in whole grasps", low=1, high=10**9
    )
    learning_rate: float = option(6e-4, "Adam's step size at the start", source="authors' code", low=0, high=1)
    learning_rate_end: float = option(0.05, "what is left of it at the end, linearly, as a fraction", low=0, high=1)
    discount: float = option(0.97, "γ; the authors had 0.99", low=0, high=1)
    gae_lambda: float = option(0.95, "λ of the advantage estimate", source="authors' code", low=0, high=1)
    clip: float = option(0.2, "largest change of the probability ratio", source="authors' code", low=0.001, high=1)
    entropy_weight: float = option(0.0, "weight of the entropy bonus", source="authors' code", low=0, high=10)
    value_weight: float = option(0.5, "weight of the value loss", source="authors' code", low=0, high=100)
    max_grad_norm: float = option(
        0.5, "gradients are scaled down to this norm", source="authors' code", low=0, high=1000
    )
    critic: str = option(
        "privileged",
        "what the value network sees while training: the policy's observation, or also the grasp's true state",
        choices=("observation", "privileged"),
    )
    teacher_weight: float = option(
        0.0,
        "weight at the start of the loss that draws the policy to a teacher that knows the object; 0: no teacher",
        source="Schmitt et al. 2018",
        low=0,
        high=1000,
    )
    teacher_weight_end: float = option(0.0, "what is left of it at the end, linearly, as a fraction", low=0, high=1)
    teacher_feedback: float = option(
        0.5, "by how much of the relative force error the teacher corrects its command", low=0, high=10
    )
    teacher_caution: float = option(
        0.0, "weight of the square of what is closed harder than the teacher by, beyond a tenth", low=0, high=1000
    )


@dataclass
class SACConfig(AlgorithmConfig):
    """Soft actor-critic (Haarnoja et al. 2018), which learns from transitions of earlier batches, too."""

    name: ClassVar[str] = "sac"

    total_frames: int = option(500_000, "control steps to train for, over all grasps", low=1, high=10**12)
    grasps: int = option(32, "grasps simulated at once; a batch is one episode of each", low=1, high=100_000)
    hidden: list[int] = option([100, 100], "width of each hidden layer, policy and value alike", low=1, high=10_000)
    log_std: float = option(-2.0, "logarithm of the policy's initial standard deviation", low=-10, high=2)
    buffer: int = option(100_000, "transitions kept, the newest; checkpoints have them, too", low=1, high=10**9)
    updates: int = option(400, "gradient steps after each batch", low=1, high=10**6)
    minibatch: int = option(256, "transitions per gradient step", low=1, high=10**9)
    learning_rate: float = option(1e-3, "Adam's step size", low=0, high=1)
    discount: float = option(0.97, "γ", low=0, high=1)
    target_rate: float = option(0.02, "by how much the target networks follow in a step, τ", low=1e-6, high=0.5)
    entropy_weight: float = option(0.01, "weight of the entropy at the start; it is learned, too", low=1e-9, high=10)
    entropy_target: float = option(-2.0, "entropy per motor that its weight is learned to keep, nats", low=-20, high=2)
    critic: str = option(
        "privileged",
        "what the value networks see while training: the policy's observation, or also the grasp's true state",
        choices=("observation", "privileged"),
    )
