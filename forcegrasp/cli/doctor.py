"""``forcegrasp doctor``: is this installation, a gripper or a measurement set in order?"""

from __future__ import annotations

from pathlib import Path

from forcegrasp.cli.verb import Verb
from forcegrasp.errors import ConfigError

NOTES = """
Looks at Python and packages, at the physics (a grasp of each gripper that comes with the package), the renderer of
videos, cores, memory, disk, and at variables of the environment; or alone at

  gripper=GRIPPER   what its description says, by name or path, how it grasps in its scene, and whether its sensors
                    feel that
  data=SET          what a measurement set holds, and whether it can be right; nothing is fitted

A line each:

  fine      as it should be
  note      good to know
  warning   works, but not as well as it could
  mend      does not work as it is; the line says what to do

Exit status: 0, or 1 if something must be mended.
"""


def run(arguments: list[str]) -> int:
    """Runs the verb; returns the exit status."""
    if len(arguments) == 1 and Path(arguments[0]).is_dir():  # a set needs no data=
        arguments = [f"data={arguments[0]}"]
    key, _, name = (arguments or [""])[0].partition("=")
    from forcegrasp.doctor import examine
    from forcegrasp.doctor.gripper import check_gripper
    from forcegrasp.doctor.measurements import check_data

    alone = {"gripper": check_gripper, "data": check_data}
    if arguments and (len(arguments) > 1 or key not in alone or not name):
        told = f"doctor takes gripper=NAME or data=SET, not {' '.join(arguments)!r}"
        raise ConfigError(f"{told}; see forcegrasp doctor --help")
    levels = []
    for finding in examine([lambda: alone[key](name)]) if name else examine():
        print(finding.line(), flush=True)
        levels.append(finding.level)
    bad, odd = levels.count("mend"), levels.count("warning")
    warnings = f" ({odd} warning{'s'[: odd != 1]})" if odd else ""
    print(f"{bad} thing{'s'[: bad != 1]} to mend{warnings}" if bad else f"all that is needed is fine{warnings}")
    return int(bad > 0)


VERB = Verb(
    "doctor",
    "check this installation, a gripper or a measurement set, and say what to do where something is wrong",
    run=run,
    notes=NOTES,
    usage="[gripper=GRIPPER | data=SET]",
    needs_mujoco=False,
)
