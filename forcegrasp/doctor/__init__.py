"""Looks at an installation and says what is fine and what to do. A check is a function that yields findings.

Nothing here imports a package that may be broken: what must be tried is tried in a process of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from forcegrasp.doctor.environment_variables import check_mujoco_gl, check_python_path
from forcegrasp.doctor.finding import LEVELS, Finding, warning
from forcegrasp.doctor.installation import check_data, check_installation
from forcegrasp.doctor.machine import check_cores, check_memory, check_runs_folder
from forcegrasp.doctor.packages import (
    check_extras,
    check_imports,
    check_mujoco,
    check_python,
    check_requirements,
    check_torch_family,
)
from forcegrasp.doctor.physics import check_physics, check_renderer

__all__ = ["CHECKS", "LEVELS", "Check", "Finding", "examine"]

Check = Callable[[], Iterable[Finding]]
CHECKS: tuple[Check, ...] = (
    check_python,
    check_installation,
    check_requirements,
    check_torch_family,
    check_mujoco,
    check_imports,
    check_extras,
    check_data,
    check_physics,
    check_renderer,
    check_mujoco_gl,
    check_python_path,
    check_cores,
    check_memory,
    check_runs_folder,
)


def examine(checks: Iterable[Check] = CHECKS) -> Iterator[Finding]:
    """Runs the checks one after the other; one that fails itself is a finding, too."""
    for check in checks:
        try:
            yield from check()
        except Exception as error:  # whatever it is, the other checks are still worth having
            name = check.__name__.removeprefix("check_").replace("_", " ")
            told = f"could not be checked ({type(error).__name__}: {error})"
            yield warning(name, told, "mend what else is told first, then look again")
