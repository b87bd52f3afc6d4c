"""``forcegrasp render``: one grasp as a video, or live."""

from __future__ import annotations

import time
from importlib.util import find_spec
from pathlib import Path

from forcegrasp.cli.verb import Verb
from forcegrasp.config.verbs import RenderConfig
from forcegrasp.errors import ConfigError, writing

NOTES = """
  policy=NAME        a run directory, a shipped policy or a controller
  'policies=[A,B]'   several, on the same grasp, one below the other
  out=NAME.mp4       instead of a GIF: pip install 'forcegrasp[video]'
  live=true          MuJoCo's viewer instead of a video, or with out= before it; policies one after another

What is not given of the grasp is drawn from the seed.
"""


def run(config: RenderConfig) -> None:
    """Runs the verb."""
    out = Path(config.out or f"runs/render_{time.strftime('%Y-%m-%d_%H-%M-%S')}.gif")
    if out.suffix.lower() not in (".gif", ".mp4"):
        raise ConfigError(f"out={out}: videos are GIF or MP4; name a file that ends with .gif or .mp4")
    if out.suffix.lower() == ".mp4" and not find_spec("imageio_ffmpeg"):
        raise ConfigError(f"out={out}: needs imageio-ffmpeg: pip install 'forcegrasp[video]'; or name a .gif")
    if config.live and config.physics.engine != "mujoco":
        raise ConfigError("live=true: the viewer shows engine mujoco alone; leave physics=warp out")
    if config.model and config.b2 is not None:
        raise ConfigError("b2: the model brings its own; leave it out, or the model")

    from forcegrasp.evaluate.render import render

    with writing(out):
        render(config, out if config.out or not config.live else None)


VERB = Verb(
    "render",
    "play one grasp and show it as a video, or live: the scene, the forces, the object's displacement",
    run=run,
    notes=NOTES,
    schema=RenderConfig,
)
