"""Trainings on the experiment ib_tuned, each reporting how its training episodes went, batch by batch.

Both have the same problem, curriculum and number of frames to anneal it over; the reward is the normalised form,
mean of the episodes of a batch, actions explored.
"""

# pyright: reportMissingImports=false

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from forcegrasp.config import TrainConfig
from tools.bench.peers import sb3_envs, sb3_ppo
from tools.bench.plain_grasp import PlainGrasp

if TYPE_CHECKING:
    import numpy as np

#: Takes frames trained so far and the mean reward of the newest episodes.
Report = Callable[[int, float], None]


def tuned(tier: str) -> TrainConfig:
    """What ``forcegrasp train experiment=ib_tuned`` trains."""
    from forcegrasp.cli.options import compose

    return compose("train", ["experiment=ib_tuned", f"physics={tier}"])


def ours(tier: str, grasps: int, report: Report) -> None:
    """This project's training; ``grasps`` is the experiment's own."""
    from forcegrasp.env.episodes import summarise
    from forcegrasp.train.collector import collecting
    from forcegrasp.train.loop import Trainer

    trainer = Trainer(config := tuned(tier))
    with collecting(trainer.next_batch):
        while trainer.frames < config.ppo.total_frames:
            batch = trainer.collect()[0]
            reward = float(summarise(batch, config.sensors)["force_reward_normalised"].mean())
            report(trainer.frames + batch.numel(), reward)
            trainer.algorithm.set_progress(trainer.frames / config.ppo.total_frames)
            trainer.algorithm.update(batch)
            trainer.frames += batch.numel()


def sb3(tier: str, grasps: int, report: Report, closing: bool) -> None:
    """The authors' trainer, in ``grasps`` processes, on the plain environment.

    Its defaults explore around no motion, and may not meet the object for long: ``closing`` starts with the mean
    action and the deviation of this project's policies in their place.
    """
    import torch
    from stable_baselines3.common.callbacks import BaseCallback

    from forcegrasp.curriculum.schedule import LinearSchedule

    config = tuned(tier)
    schedule = LinearSchedule(config.curriculum, config.grasp, config.reward, config.ppo.total_frames)
    envs = sb3_envs([partial(PlainGrasp, config, seed) for seed in range(grasps)], PlainGrasp.__module__)

    class Watch(BaseCallback):
        def _on_rollout_start(self) -> None:
            self.rewards: list[float] = []
            envs.env_method("anneal", schedule(self.num_timesteps))

        def _on_step(self) -> bool:
            infos: list[dict[str, float | np.ndarray]] = self.locals["infos"]
            self.rewards += [float(info["force_reward"]) for info in infos if "force_reward" in info]
            return True

        def _on_rollout_end(self) -> None:
            report(self.num_timesteps, sum(self.rewards) / max(1, len(self.rewards)))

    model = sb3_ppo(envs)
    if closing:
        parameters = dict(model.policy.named_parameters())
        torch.nn.init.constant_(parameters["action_net.bias"], config.ppo.initial_action)
        torch.nn.init.constant_(parameters["log_std"], config.ppo.log_std)
    model.learn(config.ppo.total_frames, callback=Watch())


TRAININGS: dict[str, Callable[[str, int, Report], None]] = {
    "forcegrasp": ours,
    "SB3": partial(sb3, closing=False),
    "SB3, closing first": partial(sb3, closing=True),
}
#: What is watched, and at which tier. Ours at the other's tier, too: what is left is the stack.
LEARNED = (
    ("forcegrasp", "fast"),
    ("forcegrasp", "reference"),
    ("SB3, closing first", "reference"),
    ("SB3", "reference"),
)
