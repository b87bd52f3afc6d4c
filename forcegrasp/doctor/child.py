"""Runs Python in a process of its own: what a broken package does there, crashes included, the doctor survives."""

from __future__ import annotations

import dataclasses
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

LIMIT_S = 180


@dataclasses.dataclass(frozen=True)
class Child:
    """How it went."""

    output: str
    failure: str  #: why it failed, in a line; "" if it did not


def run_python(*arguments: str, **environment: str) -> Child:
    """Runs this interpreter with arguments, and variables on top of the environment.

    MuJoCo loads no OpenGL there unless ``MUJOCO_GL`` is given. The working directory is not searched for modules, as it
    is not by the command ``forcegrasp``.
    """
    command = [sys.executable, "-P", "-W", "ignore", *arguments]
    # forcegrasp itself is found where this process found it
    places = [*filter(None, [os.environ.get("PYTHONPATH")]), str(Path(__file__).parents[2])]
    variables = {**os.environ, "MUJOCO_GL": "disable", "PYTHONPATH": os.pathsep.join(places), **environment}
    try:
        done = subprocess.run(command, env=variables, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    except subprocess.TimeoutExpired:
        return Child("", f"no answer within {LIMIT_S} s")
    if done.returncode < 0:
        return Child(done.stdout, f"the process died of {signal.Signals(-done.returncode).name}")
    raised = re.findall(r"^[\w.]+(?:Error|Exception)\b.*", done.stderr, re.MULTILINE)
    return Child(done.stdout, (raised or [f"exit status {done.returncode}"])[-1] if done.returncode else "")
