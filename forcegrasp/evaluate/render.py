"""Plays one grasp with each of some policies, and shows them in one video."""

from __future__ import annotations

import contextlib
from pathlib import Path

import torch

from forcegrasp.config import GraspConfig, RenderConfig
from forcegrasp.env.episodes import summarise
from forcegrasp.evaluate.grasp_figure import describe
from forcegrasp.evaluate.live import LiveView
from forcegrasp.evaluate.one_grasp import draw_one_grasp
from forcegrasp.evaluate.policies import load_policies
from forcegrasp.evaluate.rollouts import roll_out
from forcegrasp.evaluate.video import grasp_video
from forcegrasp.models.variation import read_model_of, with_noise_of
from forcegrasp.physics.completion import complete


def render(config: RenderConfig, out: str | Path | None) -> dict[str, dict[str, float]]:
    """Writes the video and prints what happened; returns every policy's metrics of the episode.

    Args:
      config: which policies, which grasp; and whether a viewer shows it as it is simulated.
      out: the video, .gif or .mp4; None for none.

    Raises:
      ConfigError, CheckpointError, PhysicsError: with what to do about it.
      NoRendererError: where there is no OpenGL.
    """
    torch.set_num_threads(1)
    policies = load_policies(config.policies, config.gripper)
    gripper = policies[0].gripper
    model = read_model_of(gripper, config.model) if config.model else None
    config = complete(config, with_noise_of(gripper, model))
    grasp = draw_one_grasp(config, gripper)
    with LiveView(gripper.period_s) if config.live else contextlib.nullcontext() as view:
        episodes = {
            evaluated.name: roll_out(
                evaluated.policy,
                grasp,
                GraspConfig(steps=config.steps),
                config.seed,
                callback=view,
                gripper=gripper,
                physics=config.physics,
                sensors=config.sensors,
                model=model,
                action=evaluated.action,
                observation=evaluated.observation,
            )[0]
            for evaluated in policies
        }
    if out is not None:
        out = Path(out)
        data = grasp_video(episodes, config.sensors, gripper=gripper, mp4=out.suffix.lower() == ".mp4")
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_bytes(data)
    found = {
        name: {
            metric: float(value[0])
            for metric, value in summarise(episode[None], config.sensors, gripper.period_s).items()
        }
        for name, episode in episodes.items()
    }
    print(describe(next(iter(episodes.values()))))
    for name, metrics in found.items():
        touched = metrics["both_contact_s"]
        never = touched >= config.steps * gripper.period_s
        when = "never in both fingers" if never else f"in both fingers after {touched:.2f} s"
        print(
            f"{name}: force reward {metrics['force_reward_normalised']:.1f} of {config.steps}, {when},"
            f" object moved {metrics['displacement_until_grasped_mm']:.3f} mm until then,"
            f" {metrics['displacement_total_mm']:.3f} mm in all"
        )
    if out is not None:
        print(f"video: {out}")
    return found
