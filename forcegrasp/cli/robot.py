"""``forcegrasp robot``: one of the robots that policies are compared on, as a model file."""

from __future__ import annotations

from forcegrasp.cli.measuring import check_file
from forcegrasp.cli.verb import Verb
from forcegrasp.config.verbs import RobotConfig

NOTES = """
  NUMBER     which of the robots of forcegrasp evaluate plan=robots; the same number is always the same robot

The file goes wherever a model does: record a set of the robot, see what forcegrasp diagnose finds in it, train with
that, and evaluate on the robot: see docs/robots.md.
"""


def run(config: RobotConfig) -> None:
    """Runs the verb."""
    from pathlib import Path

    from forcegrasp.models.model_file import write_model
    from forcegrasp.models.robots import robot_model
    from forcegrasp.physics import load_gripper

    out = check_file(Path(config.out or f"robot_{config.number}.yaml"))
    model = robot_model(load_gripper(config.gripper), config.number)
    write_model(model, out)
    print(f"robot {config.number} of gripper {model.gripper.name}, {len(model.effects)} effects:")
    for effect in model.effects:
        print(f"  {effect.summary()}")
    print(f"wrote {out}. Measure it: forcegrasp record gripper={config.gripper} model={out}")


VERB = Verb(
    "robot",
    "write one of the robots that policies are compared on as a model",
    run=run,
    notes=NOTES,
    schema=RobotConfig,
    positional=("number", "NUMBER"),
)
