"""Are there cores, memory and disk enough, and may runs be written here?"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from forcegrasp import cgroup
from forcegrasp.cores import seen_cores, usable_cores
from forcegrasp.doctor.finding import Finding, fine, mend, note, warning

#: What a training takes, as measured, and what is little.
TRAINING_GB, LITTLE_GB = 0.6, 1.0
#: A run with its checkpoints takes a few megabytes; one with many videos, hundreds.
LITTLE_DISK_GB, NO_DISK_GB = 1.0, 0.02
MEMORY = Path("/proc/meminfo")


def check_cores() -> Iterator[Finding]:
    """Cores, a container's quota on them, and threads that are asked for."""
    cores, quota = seen_cores(), cgroup.cpu_quota()
    if quota is not None and quota < cores:
        told = f"{cores} are seen, of which this container may use {quota:.3g}; the physics takes {usable_cores()}"
        yield fine("cores", told)
    else:
        yield fine("cores", f"{cores}, all of which the physics uses; torch takes one thread while it trains")
    asked = os.environ.get("OMP_NUM_THREADS")
    if asked is not None and not (asked.isdigit() and 1 <= int(asked) <= cores):
        yield warning("cores", f"OMP_NUM_THREADS={asked} suits no machine of {cores} cores", "unset it")
    elif asked is not None:
        yield note("cores", f"OMP_NUM_THREADS={asked}, which changes no training")


def check_memory() -> Iterator[Finding]:
    """Memory that can still be had."""
    bounds = [bytes_ for bytes_ in (_available(), cgroup.memory_left()) if bytes_ is not None]
    if not bounds:
        yield note("memory", "this system does not tell how much is free")
    elif (free := min(bounds) / 1e9) < LITTLE_GB:
        told = f"{free:.2g} GB are free, a training takes about {TRAINING_GB:g} GB"
        yield warning("memory", told, "close other programs, or train with fewer grasps at once: ppo.grasps=32")
    else:
        yield fine("memory", f"{free:.1f} GB free")


def _available() -> int | None:
    try:
        lines = MEMORY.read_text("utf-8").splitlines()
    except OSError:
        return None
    return next((1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable:")), None)


def check_runs_folder() -> Iterator[Finding]:
    """The disk, and the right to write where runs go: ``runs`` in the working directory."""
    runs = Path("runs").absolute()
    place = next(folder for folder in (runs, *runs.parents) if folder.exists())
    elsewhere = "go to a folder of your own, or say where to write: hydra.run.dir=FOLDER, out=FOLDER"
    try:
        with tempfile.TemporaryFile(dir=place) as file:
            file.write(b"forcegrasp")
        free = shutil.disk_usage(place).free / 1e9
    except OSError as error:
        yield mend("disk", f"runs can't be written to {place} ({error.strerror or error})", elsewhere)
        return
    if free < NO_DISK_GB:
        yield mend("disk", f"{1000 * free:.0f} MB are free at {place}", f"make room, or {elsewhere}")
    elif free < LITTLE_DISK_GB:
        yield warning("disk", f"{1000 * free:.0f} MB are free at {place}", "make room before long trainings")
    else:
        yield fine("disk", f"runs can be written to {place}, {free:.0f} GB free")
