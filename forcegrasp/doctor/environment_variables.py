"""Variables of the environment that change what Python and MuJoCo do."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from forcegrasp.doctor.finding import Finding, fine, note, warning
from forcegrasp.doctor.packages import MODULES

#: What MuJoCo takes, by system; it refuses to be imported with anything else.
_ANYWHERE = ("disable", "disabled", "off", "false", "0", "enable", "enabled", "on", "true", "1", "glfw", "")
_RENDERERS = {"linux": ("glx", "egl", "osmesa"), "darwin": ("cgl",)}


def check_mujoco_gl() -> Iterator[Finding]:
    """MUJOCO_GL: the command line is robust to it, programs that import MuJoCo are not."""
    asked, known = os.environ.get("MUJOCO_GL"), _RENDERERS.get(sys.platform, ())
    if asked is None:
        yield fine("MUJOCO_GL", "not set: videos take what works")
    elif asked.lower().strip() in (*_ANYWHERE, *known):
        yield note("MUJOCO_GL", f"set to {asked or 'nothing'}")
    else:
        told = f"{asked} is unknown to MuJoCo on this system, so that import mujoco fails outside the command line"
        yield warning("MUJOCO_GL", told, f"unset it, or take one of {', '.join(known)}")


def check_python_path() -> Iterator[Finding]:
    """PYTHONPATH comes before the environment's own packages; a ROS set-up fills it."""
    value = os.environ.get("PYTHONPATH", "")
    names = {module.partition(".")[0] for module in MODULES}
    hiding = [
        f"{name} of {place}"
        for place in filter(None, value.split(os.pathsep))
        for name in sorted(names)
        if (Path(place) / name / "__init__.py").is_file() or (Path(place) / f"{name}.py").is_file()
    ]
    if hiding:
        told = f"hides this environment's packages: {', '.join(hiding)} would be imported"
        yield warning("PYTHONPATH", told, "unset PYTHONPATH where you run forcegrasp")
    elif value:
        yield note("PYTHONPATH", f"set to {value}, which hides nothing that is needed")
    else:
        yield fine("PYTHONPATH", "not set")
