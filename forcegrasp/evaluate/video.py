"""A grasp as a moving picture: the scene, and beside it both forces on their way to the goal.

Rendering happens in a child process: where there is no OpenGL, some drivers end the process that asked for it.
"""

from __future__ import annotations

import io
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from tensordict import TensorDictBase

WIDTH, HEIGHT = 400, 320
_BACKENDS = {"linux": ("egl", "osmesa"), "darwin": ("cgl",)}


class NoRendererError(Exception):
    """This machine can't render; the message says what would help."""


def grasp_video(episode: TensorDictBase, tier: str, every: int = 2) -> bytes:
    """Replays one recorded episode ``(T,)`` and returns it as an animated GIF.

    Args:
      episode: one episode of an env's rollout.
      tier: physics tier it was recorded on.
      every: control steps per picture.

    Raises:
      NoRendererError: where there is no OpenGL.
    """
    from forcegrasp.evaluate.plots import draw_episode, figure_pixels

    chart = figure_pixels(draw_episode(episode, WIDTH, HEIGHT))
    asked = os.environ.get("MUJOCO_GL")
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "episode.npz", Path(folder) / "grasp.gif"
        np.savez(
            source,
            parameters=episode["grasp_parameters"][:1].double().numpy(),
            commands=episode["next", "commanded_position"].double().numpy(),
            chart=chart,
        )
        for backend in (asked,) if asked else _BACKENDS.get(sys.platform, ("glfw",)):
            command = [sys.executable, "-m", "forcegrasp.evaluate.video", str(source), str(target), tier, str(every)]
            environment = {**os.environ, "MUJOCO_GL": backend}
            subprocess.run(command, env=environment, cwd=folder, capture_output=True, check=False)
            if target.exists():
                return target.read_bytes()
    raise NoRendererError("no OpenGL without a display; install libegl1 or libosmesa6 (Debian's names) to get videos")


def _render(source: Path, target: Path, tier: str, every: int) -> None:
    import mujoco
    from PIL import Image, ImageDraw

    from forcegrasp.physics import GraspParameters, GraspSimulator

    with np.load(source, allow_pickle=False) as file:
        parameters, commands, chart = file["parameters"], file["commands"], file["chart"]
    simulator = GraspSimulator(1, tier, threads=1)
    simulator.reset(GraspParameters.from_array(parameters))
    renderer = mujoco.Renderer(simulator.scene(0)[0], HEIGHT, WIDTH)
    left, right = WIDTH * 1.19, WIDTH * 1.96  # the axes of draw_episode
    pictures = []
    for step, command in enumerate(commands):
        simulator.command(command[None])
        if step % every:
            continue
        renderer.update_scene(simulator.scene(0)[1], camera="side")
        picture = Image.new("RGB", (2 * WIDTH, HEIGHT))
        picture.paste(Image.fromarray(renderer.render()), (0, 0))
        picture.paste(Image.fromarray(chart), (WIDTH, 0))
        x = left + (right - left) * (step + 1) / len(commands)
        ImageDraw.Draw(picture).line([(x, 0.08 * HEIGHT), (x, 0.86 * HEIGHT)], fill=(120, 120, 120))
        pictures.append(picture.quantize(64, dither=Image.Dither.NONE))
    data = io.BytesIO()
    pictures[0].save(data, "GIF", save_all=True, append_images=pictures[1:], duration=40 * every, loop=0)
    target.write_bytes(data.getvalue())
    renderer.close()


if __name__ == "__main__":
    _render(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], int(sys.argv[4]))
