"""``forcegrasp export``: a trained policy as a folder that runs on a robot, without torch."""

from __future__ import annotations

from forcegrasp.cli.measuring import check_folder
from forcegrasp.cli.results import default_out
from forcegrasp.cli.verb import Verb
from forcegrasp.config.verbs import ExportConfig
from forcegrasp.errors import ConfigError, writing

NOTES = """
  RUN        a run directory of forcegrasp train, the name of a policy that comes with the package, or force_pi,
             the hand-written controller

Writes policy.onnx and contract.json (readings, scaling, stacking, limits). forcegrasp.deploy.GraspController runs them
with numpy and onnxruntime: see docs/deploy.md. Needs pip install 'forcegrasp[onnx]'. For force_pi it writes
contract.json alone, without that extra; gripper= says for which gripper.
"""


def run(config: ExportConfig) -> None:
    """Runs the verb."""
    if not config.run.strip():
        raise ConfigError("which run? forcegrasp export runs/RUN")
    out = check_folder(default_out("export", config.out))

    from forcegrasp.runs.export import CHECKS, export_policy

    with writing(out):
        done = export_policy(config.run, out, config.ceiling_n, config.gripper)
    if done.difference is None:
        print(f"{out}: contract.json ({done.contract})")
    else:
        print(f"{out}: policy.onnx and contract.json ({done.contract})")
        print(f"acts like the policy in torch: to {done.difference:.1g} over {CHECKS} random observations")
    print(f"a step takes {done.step_us:.0f} µs here (median of {CHECKS})")


VERB = Verb(
    "export",
    "write a trained policy as a folder that runs on a robot, without torch",
    run=run,
    notes=NOTES,
    schema=ExportConfig,
    positional=("run", "RUN"),
)
