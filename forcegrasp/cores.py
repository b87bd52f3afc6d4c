"""How many cores there are for this process."""

from __future__ import annotations

import math
import os

from forcegrasp import cgroup


def seen_cores() -> int:
    """Cores that this process may run on: those that a scheduler, or ``taskset``, leaves it."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def usable_cores() -> int:
    """The same, or fewer where a container gets less time than that; more threads than these only wait."""
    quota = cgroup.cpu_quota()
    return seen_cores() if quota is None else max(1, min(seen_cores(), math.floor(quota)))
