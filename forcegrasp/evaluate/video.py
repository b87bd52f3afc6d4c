"""A grasp as a moving picture: the scene, and beside it forces and displacement as they come about."""

from __future__ import annotations

import importlib
import io
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from forcegrasp.config import SensorConfig
from forcegrasp.evaluate.grasp_layout import (
    BOTTOM_EDGE,
    LEFT_EDGE,
    RIGHT_EDGE,
    SCENE_HEIGHT,
    SCENE_WIDTH,
    TOP_EDGE,
)
from forcegrasp.physics import Gripper, default_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.physics.scene_renderer import SceneRenderer

if TYPE_CHECKING:
    from PIL import Image
    from tensordict import TensorDictBase

#: How long the end is shown, seconds.
LAST_S = 1
#: How much of what has not happened yet shines through.
_AHEAD = 0.15


def grasp_video(
    episodes: dict[str, TensorDictBase],
    sensors: SensorConfig,
    every: int = 2,
    colours: dict[str, str] | None = None,
    gripper: Gripper | None = None,
    mp4: bool = False,
) -> bytes:
    """Shows recorded episodes, one below the other, as an animated GIF, or as an MP4 (H.264).

    Args:
      episodes: title → one episode ``(T,)`` of an env's rollout; all of the same length.
      sensors: σ_f of the band around the goal, and f_θ, above which a finger touches.
      every: control steps per picture.
      colours: title → colour; the titles are names of policies, and have theirs, if not given.
      gripper: that is seen; the paper's by default.
      mp4: the format, which the package imageio-ffmpeg writes.

    Raises:
      NoRendererError: where there is no OpenGL.
      ModuleNotFoundError: if imageio-ffmpeg is needed and not installed.
    """
    from forcegrasp.evaluate.grasp_figure import draw_grasps, from_the_start
    from forcegrasp.evaluate.plots import figure_pixels

    gripper = gripper or default_gripper()
    steps = len(from_the_start(next(iter(episodes.values())), "joint_position")) - 1
    shown = sorted({*range(0, steps + 1, every), steps})
    rows = []
    with SceneRenderer(SCENE_WIDTH, SCENE_HEIGHT, gripper) as renderer:
        charts = draw_grasps(episodes, complete(sensors, gripper), colours, gripper.period_s)
        for episode, figure in zip(episodes.values(), charts, strict=True):
            parameters = episode.get("grasp_parameters")[0].double().numpy()
            fingers = from_the_start(episode, "joint_position")
            objects = from_the_start(episode, "object_position")[:, 0]
            chart = figure_pixels(figure)
            rows.append(
                [
                    _picture(chart, renderer.draw(parameters, fingers[step], objects[step]), step / steps)
                    for step in shown
                ]
            )
    pictures = [np.concatenate(parts) for parts in zip(*rows, strict=True)]
    return _mp4(pictures, gripper.period_s * every) if mp4 else _gif(pictures, gripper.period_s * every)


def _gif(pictures: list[np.ndarray], seconds: float) -> bytes:
    """Pictures that last so long each; the last one longer, to look at the end."""
    from PIL import Image

    palette = _palette(pictures)
    images = [Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    data = io.BytesIO()
    durations = [round(1000 * seconds)] * (len(images) - 1) + [LAST_S * 1000]
    images[0].save(data, "GIF", save_all=True, append_images=images[1:], duration=durations, loop=0)
    return data.getvalue()


def _mp4(pictures: list[np.ndarray], seconds: float) -> bytes:
    """The same for players that want a film; its sides are even, as the codec has them."""
    ffmpeg = importlib.import_module("imageio_ffmpeg")  # an extra
    height, width = (side // 2 * 2 for side in pictures[0].shape[:2])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "grasp.mp4"
        film = ffmpeg.write_frames(path, (width, height), fps=1 / seconds, macro_block_size=2)
        film.send(None)
        for picture in (*pictures, *pictures[-1:] * round(LAST_S / seconds)):
            film.send(np.ascontiguousarray(picture[:height, :width]))
        film.close()
        return path.read_bytes()


def _palette(pictures: list[np.ndarray]) -> Image.Image:
    """Colours for all pictures, lest they flicker: white, and as many for the scene as for the charts."""
    from PIL import Image

    some = np.concatenate([pictures[0], pictures[len(pictures) // 2], pictures[-1]])
    colours = [255, 255, 255]
    for part in (some[:, :SCENE_WIDTH], some[:, SCENE_WIDTH:]):
        quantized = Image.fromarray(np.ascontiguousarray(part)).quantize(127)
        colours += (quantized.getpalette() or [])[: 3 * 127]
    palette = Image.new("P", (1, 1))
    palette.putpalette(colours)
    return palette


def _picture(chart: np.ndarray, scene: np.ndarray, share: float) -> np.ndarray:
    """The chart with the scene in its place, faded where it shows what comes after ``share`` of the episode."""
    picture = chart.copy()
    picture[-len(scene) :, : scene.shape[1]] = scene
    now = LEFT_EDGE + 1 + round(share * (RIGHT_EDGE - LEFT_EDGE - 2))
    ahead = picture[TOP_EDGE + 1 : BOTTOM_EDGE, now : RIGHT_EDGE - 1]
    ahead[:] = 255 - (_AHEAD * (255 - ahead)).astype(np.uint8)
    if share < 1:
        picture[TOP_EDGE + 1 : BOTTOM_EDGE, now] = 120
    return picture
