"""``forcegrasp export``: a trained policy as a folder that runs on a robot, without torch."""

from __future__ import annotations

from forcegrasp.cli.measuring import check_folder
from forcegrasp.cli.options import compose, help_text
from forcegrasp.cli.results import default_out
from forcegrasp.errors import ConfigError

PURPOSE = "write a trained policy as a folder that runs on a robot, without torch"
NOTES = """
  RUN        a run directory of forcegrasp train, or the name of a policy that comes with the package

Writes policy.onnx and contract.json (scaling, stacking, limits). forcegrasp.deploy.GraspController runs them with
numpy and onnxruntime: see docs/deploy.md. Needs pip install 'forcegrasp[onnx]'.
"""


def main(arguments: list[str]) -> int:
    """Runs the verb; returns the exit status."""
    if any(a in ("-h", "--help") for a in arguments):
        print(help_text("export", PURPOSE, NOTES, "RUN"), end="")
        return 0
    config = compose("export", arguments)
    if not config.run.strip():
        raise ConfigError("which run? forcegrasp export runs/RUN")
    out = check_folder(default_out("export", config.out))

    from forcegrasp.runs.export import CHECKS, export_policy

    try:
        done = export_policy(config.run, out, config.ceiling_n)
    except OSError as error:
        raise ConfigError(f"out={out}: could not write ({error.strerror})") from error
    print(f"{out}: policy.onnx and contract.json ({done.contract})")
    print(f"acts like the policy in torch: to {done.difference:.1g} over {CHECKS} random observations")
    print(f"a step takes {done.step_us:.0f} µs here (median of {CHECKS})")
    return 0
