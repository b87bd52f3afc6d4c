"""What a container lets its processes have, where the system has control groups (Linux)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

GROUPS = Path("/sys/fs/cgroup")
MEMBERSHIP = Path("/proc/self/cgroup")


def cpu_quota() -> float | None:
    """Cores' worth of time; None if it is not limited."""
    quotas = []
    for folder in _folders("cpu"):
        both = _text(folder / "cpu.max").split()  # version 2
        both = both or [_text(folder / "cpu.cfs_quota_us"), _text(folder / "cpu.cfs_period_us")]  # version 1
        if len(both) == 2 and both[0].isdigit() and both[1].isdigit() and int(both[1]):
            quotas.append(int(both[0]) / int(both[1]))
    return min(quotas, default=None)


def memory_left() -> int | None:
    """Bytes until the limit; None if there is no limit."""
    left = []
    for folder in _folders("memory"):
        for limit, usage in (("memory.max", "memory.current"), ("memory.limit_in_bytes", "memory.usage_in_bytes")):
            most, used = _text(folder / limit), _text(folder / usage)
            if most.isdigit() and used.isdigit() and int(most) < 1 << 60:  # version 1 says "no limit" as a huge number
                left.append(int(most) - int(used))
    return min(left, default=None)


def _folders(controller: str) -> Iterator[Path]:
    """The folders of this process' group and of those around it: each may have a limit."""
    for line in _text(MEMBERSHIP).splitlines():
        number, controllers, path = line.split(":", 2)
        if number == "0" or controller in controllers.split(","):
            top = GROUPS if number == "0" else GROUPS / controllers
            top = top if top.is_dir() else GROUPS / controller
            own = top / path.strip("/")
            yield from (folder for folder in (own, *own.parents) if folder.is_relative_to(top))


def _text(path: Path) -> str:
    try:
        return path.read_text("utf-8").strip()
    except OSError:
        return ""
