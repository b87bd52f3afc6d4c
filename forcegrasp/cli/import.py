"""``forcegrasp import``: logs of a servo as a measurement set."""  # noqa: N999

from __future__ import annotations

from pathlib import Path

from forcegrasp.cli.results import default_out
from forcegrasp.cli.verb import Verb
from forcegrasp.config.verbs import ImportConfig
from forcegrasp.errors import ConfigError

NOTES = """
  SOURCE           a file, or a folder of recordings; each recording is an episode of the set
  format=sage|bam|emps|dfki|pace|lerobot
                   how it is written; each has a mechanism, the model that it is compared with, except pace
  map=FILE         for any CSV, Parquet or ROS bag: which column is what, in which unit; see docs/servos.md
  'joints=[Jaw]'   which joint, where a log has several
"""


def run(config: ImportConfig) -> None:
    """Runs the verb."""
    from forcegrasp.importers import mechanism_of, read_source, unlike
    from forcegrasp.importers.example import example_set
    from forcegrasp.importers.servo_set import as_set
    from forcegrasp.measure import check_servo, write_servo_set
    from forcegrasp.physics.gripper_file import load_gripper

    out = default_out("import", config.out)
    if config.example:
        write_servo_set(example_set(), out)
        print(f"wrote {out}, a jaw with dry friction that its model lacks: forcegrasp diagnose data={out}")
        return
    if not config.source:
        raise ConfigError("which recordings? forcegrasp import SOURCE format=sage, or example=true for a starter set")
    form = "" if config.format == "map" else config.format
    recordings = read_source([Path(source) for source in config.source], form, config.map, config.joints)
    name = config.mechanism or (mechanism_of(form, recordings) if form else "")
    if not name:
        raise ConfigError("mechanism: what was recorded? Give the name of a shipped one, or a description's path")
    mechanism = load_gripper(name)
    measured = as_set(recordings, mechanism, ", ".join(config.source), config.license)
    for note in dict.fromkeys(note for one in recordings for note in one.notes):
        print(f"note: {note}")
    for line in unlike(form, recordings) if form and not config.mechanism else ():
        print(f"warning: {line}")
    spans = [motor.stroke for motor in mechanism.motors]
    for warning in check_servo(measured, spans, mechanism.unsigned, mechanism.settings):
        print(f"warning: {warning}")
    write_servo_set(measured, out)
    samples = sum(len(one.time_s) for one in measured.grasps)
    print(f"wrote {out}: {len(measured.grasps)} recordings, {samples:,} samples of {name}")
    print(f"see where the model fails: forcegrasp compare data={out}")


VERB = Verb(
    "import",
    "make a measurement set from logs of a servo",
    run=run,
    notes=NOTES,
    schema=ImportConfig,
    positional=("source", "SOURCE"),
)
