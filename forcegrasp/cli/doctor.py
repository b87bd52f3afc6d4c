"""``forcegrasp doctor``: is this installation in order?"""

from __future__ import annotations

from forcegrasp.cli.verb import Verb
from forcegrasp.errors import ConfigError

NOTES = """
Looks at Python and packages, at the physics (a grasp of each gripper that comes with the package), the renderer of
videos, cores, memory, disk, and at variables of the environment. A line each:

  fine      as it should be
  note      good to know
  warning   works, but not as well as it could
  mend      does not work as it is; the line says what to do

Exit status: 0, or 1 if something must be mended.
"""


def run(arguments: list[str]) -> int:
    """Runs the verb; returns the exit status."""
    if arguments:
        raise ConfigError(f"doctor takes no options, not {' '.join(arguments)!r}; see forcegrasp doctor --help")
    from forcegrasp.doctor import examine

    levels = []
    for finding in examine():
        print(finding.line(), flush=True)
        levels.append(finding.level)
    bad, odd = levels.count("mend"), levels.count("warning")
    warnings = f" ({odd} warning{'s'[: odd != 1]})" if odd else ""
    print(f"{bad} thing{'s'[: bad != 1]} to mend{warnings}" if bad else f"all that is needed is fine{warnings}")
    return int(bad > 0)


VERB = Verb(
    "doctor",
    "check this installation and say what to do where something is wrong",
    run=run,
    notes=NOTES,
    usage="[--help]",
    needs_mujoco=False,
)
