"""``forcegrasp evaluate``: policies and controllers on the same simulated grasps."""

from __future__ import annotations

from forcegrasp.cli.results import default_out
from forcegrasp.cli.verb import Verb
from forcegrasp.config.verbs import EvaluateConfig
from forcegrasp.errors import writing
from forcegrasp.policies import shipped_policies

NOTES = f"""
  'policies=[A,B]' run directories of forcegrasp train (FOLDER/*: all in a folder); policies that come with the
                   package: {", ".join(shipped_policies()) or "none"};
                   or controllers: force_pi (Lach et al. 2022), informed (a fixed rule), close, nothing
  plan=paper       the paper's simulation experiment; objects: its six objects in the training simulator;
                   virtual_robot: the same on a gripper with effects that the training simulator does not have;
                   robots: a hundred robots, each with effects of its own, see docs/robots.md
  out=DIR          where to write report.html and what it was made from; runs/evaluate_TIME by default
"""


def run(config: EvaluateConfig) -> None:
    """Runs the verb."""
    out = default_out("evaluate", config.out)

    from forcegrasp.evaluate.compare_policies import evaluate

    with writing(out):
        evaluate(config, out)


VERB = Verb(
    "evaluate",
    "compare policies and controllers on the same simulated grasps",
    run=run,
    notes=NOTES,
    schema=EvaluateConfig,
)
