"""A grasp as a moving picture: the scene, and beside it forces and displacement as they come about.

Rendering happens in a child process: where there is no OpenGL, some drivers end the process that asked for it. The
child simulates nothing; it puts fingers and object where they were, whatever simulator or model moved them.
"""

from __future__ import annotations

import io
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from forcegrasp.config import SensorConfig
from forcegrasp.errors import ForcegraspError
from forcegrasp.evaluate.grasp_layout import (
    BOTTOM_EDGE,
    LEFT_EDGE,
    RIGHT_EDGE,
    SCENE_HEIGHT,
    SCENE_WIDTH,
    TOP_EDGE,
)

if TYPE_CHECKING:
    from PIL import Image
    from tensordict import TensorDictBase

_BACKENDS = {"linux": ("egl", "osmesa"), "darwin": ("cgl",)}
#: How much of what has not happened yet shines through.
_AHEAD = 0.15


class NoRendererError(ForcegraspError):
    """This machine can't render; the message says what would help."""


def backends() -> tuple[str, ...]:
    """MuJoCo's renderers to try in turn: the one that the user asked for, or those that need no display."""
    asked = os.environ.get("MUJOCO_GL")
    return (asked,) if asked else _BACKENDS.get(sys.platform, ("glfw",))


def no_renderer() -> str:
    """Why nothing renders, and after a semicolon what to do: another choice if the user made one, else a package."""
    if asked := os.environ.get("MUJOCO_GL"):
        return f"nothing renders with MUJOCO_GL={asked}; unset MUJOCO_GL, or mend what it names"
    return "no OpenGL without a display; install libegl1 or libosmesa6 (Debian's names) to get videos"


def grasp_video(episodes: dict[str, TensorDictBase], sensors: SensorConfig, every: int = 2) -> bytes:
    """Shows recorded episodes, one below the other, as an animated GIF.

    Args:
      episodes: title → one episode ``(T,)`` of an env's rollout; all of the same length.
      sensors: σ_f of the band around the goal, and f_θ that tells when a finger touched.
      every: control steps per picture.

    Raises:
      NoRendererError: where there is no OpenGL.
    """
    from forcegrasp.evaluate.grasp_figure import draw_grasps, from_the_start
    from forcegrasp.evaluate.plots import figure_pixels

    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "episodes.npz", Path(folder) / "grasp.gif"
        np.savez(
            source,
            parameters=np.stack([e.get("grasp_parameters")[0].double().numpy() for e in episodes.values()]),
            fingers=np.stack([from_the_start(e, "joint_position") for e in episodes.values()]),
            objects=np.stack([from_the_start(e, "object_position")[:, 0] for e in episodes.values()]),
            charts=np.stack([figure_pixels(figure) for figure in draw_grasps(episodes, sensors)]),
        )
        for backend in backends():
            command = [sys.executable, "-m", "forcegrasp.evaluate.video", str(source), str(target), str(every)]
            environment = {**os.environ, "MUJOCO_GL": backend}
            subprocess.run(command, env=environment, cwd=folder, capture_output=True, check=False)
            if target.exists():
                return target.read_bytes()
    raise NoRendererError(no_renderer())


def _render(source: Path, target: Path, every: int) -> None:
    from PIL import Image

    with np.load(source, allow_pickle=False) as file:
        rows = list(zip(*(file[name] for name in ("parameters", "fingers", "objects", "charts")), strict=True))
    steps = len(rows[0][1]) - 1
    scenes = [_Scene(parameters) for parameters, *_ in rows]
    pictures = []
    for step in sorted({*range(0, steps + 1, every), steps}):
        parts = [
            _picture(chart, scene.draw(fingers[step], objects[step]), step / steps)
            for scene, (_, fingers, objects, chart) in zip(scenes, rows, strict=True)
        ]
        pictures.append(np.concatenate(parts))
    palette = _palette(pictures)
    images = [Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    data = io.BytesIO()
    durations = [40 * every] * (len(images) - 1) + [1000]  # a moment to look at the end
    images[0].save(data, "GIF", save_all=True, append_images=images[1:], duration=durations, loop=0)
    target.write_bytes(data.getvalue())


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


class _Scene:
    """Draws the gripper and one object, wherever they are told to be."""

    def __init__(self, parameters: np.ndarray) -> None:
        import mujoco

        from forcegrasp.physics import GraspParameters, GraspSimulator

        simulator = GraspSimulator(1, threads=1)
        simulator.reset(GraspParameters.from_array(parameters[None]))
        self.model, self.data = simulator.scene(0)
        self.renderer = mujoco.Renderer(self.model, SCENE_HEIGHT, SCENE_WIDTH)
        self.camera = mujoco.MjvCamera()
        self.camera.lookat[:] = (0, 0, 0.05)
        self.camera.distance, self.camera.azimuth, self.camera.elevation = 0.21, 180, -25

    def draw(self, fingers: np.ndarray, object_position: float) -> np.ndarray:
        """Picture with the fingers at ``(2,)`` metres and the object at ``object_position`` along the grasp axis."""
        import mujoco

        for name, position in zip(("finger_l", "finger_r"), fingers, strict=True):
            self.data.joint(name).qpos[0] = position
        self.data.joint("object").qpos[1] = object_position
        mujoco.mj_kinematics(self.model, self.data)
        self.renderer.update_scene(self.data, self.camera)
        self.renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False  # they take most of the time without a GPU
        return self.renderer.render()


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


if __name__ == "__main__":
    _render(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]))
