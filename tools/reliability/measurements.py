"""Measurement files that are spoilt in ten thousand ways: each is read, or refused in one line that names the file."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from forcegrasp.cli.main import main
from forcegrasp.errors import ForcegraspError
from forcegrasp.identify.sensor_noise import check_given_noise
from forcegrasp.measure import MeasurementSet, check_set, read_set
from forcegrasp.models.model_file import read_model
from forcegrasp.physics import default_gripper
from tools.reliability import spoil
from tools.reliability.child import each, fork, peak_memory_mb
from tools.reliability.training import status
from tools.reliability.trial import Promise, Trial

SECONDS = 2.0
#: More than reading the sound set takes, MB.
MEMORY_MB = 300
Spoil = Callable[[bytes, np.random.Generator], bytes]
#: Folder, file and way to spoil it, as often as it stands here.
WAYS: list[tuple[str, str, Spoil]] = [
    *[("csv", "samples.csv", way) for way in (spoil.spoil_bytes, spoil.spoil_cell, spoil.spoil_lines)],
    *[("csv", "grasps.csv", way) for way in (spoil.spoil_bytes, spoil.spoil_cell, spoil.spoil_lines)],
    *[("csv", "meta.yaml", way) for way in (spoil.spoil_bytes, spoil.spoil_yaml)],
    *[("parquet", "samples.parquet", way) for way in (spoil.spoil_bytes, spoil.spoil_footer, spoil.spoil_parquet)],
    *[("model", "model.yaml", way) for way in (spoil.spoil_bytes, spoil.spoil_yaml)],
]


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Each spoils one file of a sound set and reads the set."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        said = folder / "said"
        assert status(fork(lambda: _prepare(folder), said)) == 0, said.read_text()
        sound = {(place, file): (folder / place / file).read_bytes() for place, file, _ in WAYS}
        before = dict(
            zip(("csv", "parquet", "model"), (_memory(folder, p) for p in ("csv", "parquet", "model")), strict=True)
        )

        def attempt(number: int) -> tuple[str, str, float]:
            place, file, way = WAYS[number % len(WAYS)]
            path, data = folder / place / file, sound[place, file]
            path.write_bytes(way(data, np.random.default_rng([seed, number])))
            try:
                return *_read(folder / place, file, way is spoil.spoil_cell), peak_memory_mb()
            finally:
                path.write_bytes(data)

        for number, answer, problem in each(range(count), attempt, SECONDS):
            place, file, way = WAYS[number % len(WAYS)]
            went, complaint, memory = answer or ("broken", "", 0.0)
            if not problem and memory > before[place] + MEMORY_MB:
                complaint = complaint or f"{memory:.0f} MB where the sound set takes {before[place]:.0f}"
            if problem:  # what the process left is not what it found
                (folder / place / file).write_bytes(sound[place, file])
            yield Trial(f"{number} {file} {way.__name__}", problem or complaint, f"{went} ({file})")


def _prepare(folder: Path) -> int:
    os.chdir(folder)
    some = ["grasps=4", "objects=2", "plan=close_and_hold"]
    made = [main(["record", f"out={kind}", f"samples={kind}", *some]) for kind in ("csv", "parquet")]
    (folder / "model").mkdir()
    shipped = Path(read_model(Path("virtual_robot")).gripper.path).with_name("virtual_robot.yaml")
    (folder / "model" / "model.yaml").write_bytes(shipped.read_bytes())
    return max(made)


def _memory(folder: Path, place: str) -> float:
    """MB that a process takes which reads the sound set."""
    file = "model.yaml" if place == "model" else "meta.yaml"
    (_, answer, problem), *_ = each([0], lambda _: (*_read(folder / place, file, False), peak_memory_mb()), 60)
    assert answer, problem
    assert answer[0] == "read", answer
    return answer[2]


def _read(folder: Path, file: str, names_row: bool) -> tuple[str, str]:
    """Reads what is there; returns how it went, and what is wrong with the refusal, if it is one."""
    try:
        if file == "model.yaml":
            read_model(folder / file)
        else:
            measured = read_set(folder)
            assert isinstance(measured, MeasurementSet)  # which a table is not
            check_set(measured, default_gripper().stroke)
            check_given_noise(measured)
    except ForcegraspError as error:
        return "refused", _wrong_with(str(error), folder, names_row)
    return "read", ""


def _wrong_with(message: str, folder: Path, names_row: bool) -> str:
    if message.splitlines() != [message] or not message.isprintable() or len(message) > 600:
        return f"not one short line: {message[:200]!r}"
    if not any(str(path) in message for path in folder.iterdir()):
        return f"names no file: {message}"
    if names_row and "row" not in message and "grasp" not in message:
        return f"names no row: {message}"
    return ""


PROMISE = Promise(
    "a spoilt measurement or model file is read, or refused in one line that names it, in 2 s and little memory",
    10_000,
    130,
    trials,
)
