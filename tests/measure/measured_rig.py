"""A rig made of plain numpy: two servos of first order close on an object and squeeze it. No simulator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from forcegrasp.errors import MeasurementError
from forcegrasp.measure import MeasuredGrasp, MeasurementSet, read_set
from forcegrasp.measure.schema import fingerprint_of_set

OPEN_M = 0.045
STIFFNESS = 400.0
POSITION_STD, FORCE_STD = 2.7e-5, 0.013


def closing(time: np.ndarray, target: float = 0.015, start_s: float = 0.4, speed: float = 0.02) -> np.ndarray:
    """Wait, close at a constant speed, hold: a command ``(T,)``."""
    return np.maximum(OPEN_M - speed * np.maximum(time - start_s, 0), target)


def cycles(time: np.ndarray) -> np.ndarray:
    """Close, hold, open, and again."""
    phase = np.minimum(np.mod(time, 3.0), 3.0 - np.mod(time, 3.0))
    return np.maximum(OPEN_M - 0.035 * np.maximum(phase - 0.2, 0), 0.012)


def simulate(
    time: np.ndarray,
    command: np.ndarray,
    radius: float,
    offset: float,
    seed: int,
    *,
    lag_s: float = 0.06,
    friction: float = 0.3,
    stiffness: float = STIFFNESS,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions ``(T, 2)``, forces ``(T, 2)`` and object positions ``(T,)`` for commands ``(T, 2)``.

    The fingers press on a spring-like object, which slides once they differ by more than its friction.
    """
    rng = np.random.default_rng(seed)
    grid = np.arange(time[0], time[-1] + 1e-9, 0.001)
    held = command[np.maximum(np.searchsorted(time, grid, side="right") - 1, 0)]
    gain = 900.0  # N/m of the servo: a finger yields to the object by force / gain
    position, centre = command[0].copy(), offset
    track = np.empty((len(grid), 5))
    side = np.array([-1.0, 1.0])
    for i in range(len(grid)):
        surface = radius + side * centre
        force = stiffness * np.maximum(surface - position, 0)
        track[i] = *position, *force, centre
        goal = held[i] + force / gain
        position = position + 0.001 / lag_s * (goal - position)
        net = force[0] - force[1]  # the left finger pushes towards +y
        if abs(net) > friction:
            centre += 0.3 * (net - np.sign(net) * friction) / (2 * stiffness)
    at = np.minimum(np.searchsorted(grid, time - 1e-9), len(grid) - 1)
    position = track[at, :2] + POSITION_STD * rng.standard_normal((len(time), 2))
    force = track[at, 2:4] + FORCE_STD * rng.standard_normal((len(time), 2))
    return position, force, track[at, 4]


def make_grasp(
    number: int = 0,
    *,
    rate: float = 25.0,
    seconds: float = 4.0,
    radius: float = 0.025,
    offset: float = 0.0,
    command: Callable[[np.ndarray], np.ndarray] = closing,
    **physics,
) -> MeasuredGrasp:
    """One recorded grasp."""
    time = np.arange(int(seconds * rate)) / rate
    both = command(time)
    both = np.stack([both, both], axis=1) if both.ndim == 1 else both
    position, force, centre = simulate(time, both, radius, offset, seed=100 + number, **physics)
    return MeasuredGrasp(
        name=f"g{number}",
        object="sponge" if number % 2 else "wood",
        session="monday" if number < 3 else "tuesday",
        radius_m=radius,
        offset_m=offset,
        split="fit" if number % 3 else "check",
        time_s=time,
        command_m=both,
        position_m=position,
        force_n=force,
        object_m=centre,
    )


def make_set(grasps: list[MeasuredGrasp], path: Path = Path("rig"), **changes) -> MeasurementSet:
    """A set of these grasps."""
    facts = {"gripper": "tiago", "position_std_m": POSITION_STD, "force_std_n": FORCE_STD, "grasps": tuple(grasps)}
    facts |= {key: changes.pop(key) for key in list(changes) if key in facts}
    texts = {"path": path, "name": path.name, "source": "numpy", "license": "CC0-1.0"} | changes
    return MeasurementSet(**texts, **facts, fingerprint=fingerprint_of_set(**facts))


def standard_grasps(**options) -> list[MeasuredGrasp]:
    """Six grasps: centred, to the right and to the left, of two sizes."""
    places = [(0.025, 0.0), (0.025, 0.01), (0.02, -0.01), (0.02, 0.0), (0.025, 0.012), (0.02, -0.012)]
    return [make_grasp(i, radius=radius, offset=offset, **options) for i, (radius, offset) in enumerate(places)]


def change(grasp: MeasuredGrasp, **changes) -> MeasuredGrasp:
    """The grasp with some fields replaced, and arrays copied so that nothing is shared."""
    return replace(grasp, **{key: np.array(v) if isinstance(v, np.ndarray) else v for key, v in changes.items()})


def refuse(path: Path, *parts: str) -> str:
    """Asserts that reading is refused in one line that says all of this; returns the line."""
    with pytest.raises(MeasurementError) as caught:
        read_set(path)
    message = str(caught.value)
    assert message.splitlines() == [message]
    assert message.isprintable()
    assert len(message) < 600
    assert path.name in message
    for part in parts:
        assert part in message, message
    return message


def edit(file: Path, row: int, column: str | int, cell: str) -> None:
    """Replaces one cell of a CSV file; ``row`` counts lines from 1, as an editor does."""
    lines = file.read_text().split("\n")
    cells = lines[row - 1].split(",")
    cells[lines[0].split(",").index(column) if isinstance(column, str) else column] = cell
    lines[row - 1] = ",".join(cells)
    file.write_text("\n".join(lines))
