"""``forcegrasp evaluate``: policies and controllers on the same simulated grasps."""

from __future__ import annotations

import time
from pathlib import Path

from forcegrasp.cli.options import compose, help_text
from forcegrasp.errors import ConfigError

PURPOSE = "compare policies and controllers on the same simulated grasps"
NOTES = """
  'policies=[A,B]' run directories of forcegrasp train; policies that come with the package:
                   {shipped};
                   or controllers: force_pi (Lach et al. 2022), informed (a fixed rule), close, nothing
  plan=paper       the paper's simulation experiment; objects: its six objects in the training simulator;
                   virtual_robot: the same on a gripper with effects that the training simulator does not have
  out=DIR          where to write report.html and what it was made from; runs/evaluate_TIME by default
"""


def main(arguments: list[str]) -> int:
    """Runs the verb; returns the exit status."""
    if any(a in ("-h", "--help") for a in arguments):
        from forcegrasp.policies import shipped_policies

        notes = NOTES.format(shipped=", ".join(shipped_policies()) or "none")
        print(help_text("evaluate", PURPOSE, notes, everything="--all" in arguments), end="")
        return 0
    config = compose("evaluate", arguments)
    out = Path(config.out or f"runs/evaluate_{time.strftime('%Y-%m-%d_%H-%M-%S')}")

    from forcegrasp.evaluate.compare_policies import evaluate

    try:
        evaluate(config, out)
    except OSError as error:
        raise ConfigError(f"out={out}: could not write ({error.strerror})") from error
    return 0
