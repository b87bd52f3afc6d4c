"""Plays one grasp with each of some policies, and shows them in one video."""

from __future__ import annotations

from pathlib import Path

import torch

from forcegrasp.config import GraspConfig, RenderConfig
from forcegrasp.effects.variation import read_tiago_model
from forcegrasp.env.episodes import summarise
from forcegrasp.evaluate.contestants import load_contestants
from forcegrasp.evaluate.grasp_figure import describe
from forcegrasp.evaluate.one_grasp import draw_one_grasp
from forcegrasp.evaluate.rollouts import roll_out
from forcegrasp.evaluate.video import grasp_video
from forcegrasp.physics.model import CONTROL_PERIOD_S


def render(config: RenderConfig, out: str | Path) -> dict[str, dict[str, float]]:
    """Writes the video and prints what happened; returns every policy's figures of the episode.

    Raises:
      ConfigError, CheckpointError, PhysicsError: with what to do about it.
      NoRendererError: where there is no OpenGL.
    """
    out = Path(out)
    torch.set_num_threads(1)
    grasp = draw_one_grasp(config)
    model = read_tiago_model(config.model) if config.model else None
    episodes = {
        contestant.name: roll_out(
            contestant.policy,
            grasp,
            GraspConfig(steps=config.steps),
            config.seed,
            physics=config.physics,
            sensors=config.sensors,
            model=model,
            action=contestant.action,
            observation=contestant.observation,
        )[0]
        for contestant in load_contestants(config.policies)
    }
    data = grasp_video(episodes, config.sensors)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_bytes(data)
    found = {
        name: {figure: float(value[0]) for figure, value in summarise(episode[None], config.sensors).items()}
        for name, episode in episodes.items()
    }
    print(describe(next(iter(episodes.values()))))
    for name, figures in found.items():
        touched = figures["both_contact_s"]
        never = touched >= config.steps * CONTROL_PERIOD_S
        when = "never in both fingers" if never else f"in both fingers after {touched:.2f} s"
        print(
            f"{name}: force reward {figures['force_reward_normalised']:.1f} of {config.steps}, {when},"
            f" object moved {figures['displacement_until_grasped_mm']:.3f} mm until then,"
            f" {figures['displacement_total_mm']:.3f} mm in all"
        )
    print(f"video: {out}")
    return found
