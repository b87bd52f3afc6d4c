"""``forcegrasp render``: one grasp as a video."""

from __future__ import annotations

import time
from pathlib import Path

from forcegrasp.cli.verb import Verb
from forcegrasp.config.verbs import RenderConfig
from forcegrasp.errors import ConfigError

NOTES = """
  policy=NAME        a run directory, a shipped policy or a controller
  'policies=[A,B]'   several, on the same grasp, one below the other

What is not given of the grasp is drawn from the seed.
"""


def run(config: RenderConfig) -> None:
    """Runs the verb."""
    out = Path(config.out or f"runs/render_{time.strftime('%Y-%m-%d_%H-%M-%S')}.gif")
    if out.suffix.lower() != ".gif":
        raise ConfigError(f"out={out}: videos are written as GIF; name a file that ends with .gif")
    if config.model and config.b2 is not None:
        raise ConfigError("b2: the model brings its own; leave it out, or the model")

    from forcegrasp.evaluate.render import render

    try:
        render(config, out)
    except OSError as error:
        raise ConfigError(f"out={out}: could not write ({error.strerror})") from error


VERB = Verb(
    "render",
    "play one grasp and show it as a video: the scene, the forces, the object's displacement",
    run=run,
    notes=NOTES,
    schema=RenderConfig,
)
