"""What may be wrong with a set instead of the model: with what is written, not with what happened."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Sheet:
    """What is written of a recording. G grasps, S samples."""

    period_s: float
    label: list[str]  # object of each grasp
    session: np.ndarray  # (G,), 1, 2, …
    radius: np.ndarray  # (G,), metres
    offset: np.ndarray  # (G,), metres
    commands: np.ndarray  # (G, S, 2), metres
    q: np.ndarray  # (G, S, 2), metres
    f: np.ndarray  # (G, S, 2), newtons


Spoil = Callable[[Sheet, np.random.Generator], Sheet]


def _larger(by: float) -> Spoil:
    return lambda sheet, rng: replace(sheet, radius=sheet.radius + by)


def _calliper(sheet: Sheet, rng: np.random.Generator) -> Sheet:
    """Every object 0.3 mm off, to either side."""
    off = {label: rng.choice([-3e-4, 3e-4]) for label in dict.fromkeys(sheet.label)}
    return replace(sheet, radius=sheet.radius + [off[label] for label in sheet.label])


def _one_radius(sheet: Sheet, rng: np.random.Generator) -> Sheet:
    """One object is 2 mm wider or narrower than is written."""
    wrong, by = str(rng.choice(sorted(set(sheet.label)))), rng.choice([-2e-3, 2e-3])
    return replace(sheet, radius=sheet.radius + np.where(np.array(sheet.label) == wrong, by, 0.0))


def _swapped_labels(sheet: Sheet, rng: np.random.Generator) -> Sheet:
    """Two grasps of different objects have each other's label, and what is known of the object with it."""
    one = int(rng.integers(len(sheet.label)))
    other = int(rng.choice([k for k, label in enumerate(sheet.label) if label != sheet.label[one]]))
    order = np.arange(len(sheet.label))
    order[[one, other]] = order[[other, one]]
    return replace(sheet, label=[sheet.label[k] for k in order], radius=sheet.radius[order])


def _late(sheet: Sheet, **columns: np.ndarray) -> Sheet:
    return replace(sheet, **{k: np.concatenate([v[:, :1], v[:, :-1]], axis=1) for k, v in columns.items()})


def _tare(sheet: Sheet, rng: np.random.Generator) -> Sheet:
    """From somewhere in the middle on the left sensor has another zero."""
    first, f = int(rng.integers(len(sheet.f) // 3, 2 * len(sheet.f) // 3)), sheet.f.copy()
    f[first:, :, 0] += 0.1
    return replace(sheet, f=f)


def _of_each_session(sheet: Sheet, std: float, rng: np.random.Generator) -> np.ndarray:
    """A zero of each session's own for two columns, ``(G, 1, 2)``."""
    days = np.unique(sheet.session)
    return rng.normal(0.0, std, (len(days), 1, 2))[np.searchsorted(days, sheet.session)]


def _homed_anew(sheet: Sheet, rng: np.random.Generator) -> Sheet:
    """Before each session the gripper was homed: encoders and commands have another zero in each."""
    off = _of_each_session(sheet, 2e-4, rng)
    return replace(sheet, q=sheet.q + off, commands=sheet.commands + off)


def _tared_anew(sheet: Sheet, rng: np.random.Generator) -> Sheet:
    """Before each session force sensors were set to zero, carelessly."""
    return replace(sheet, f=sheet.f + _of_each_session(sheet, 0.04, rng))


SPOILED: dict[str, Spoil] = {
    "": lambda sheet, rng: sheet,
    "calliper": _calliper,
    "radius_0.3mm": _larger(3e-4),
    "radius_2mm": _larger(2e-3),
    "one_radius": _one_radius,
    "positions_swapped": lambda sheet, rng: replace(sheet, q=sheet.q[:, :, ::-1]),
    "forces_swapped": lambda sheet, rng: replace(sheet, f=sheet.f[:, :, ::-1]),
    "labels_swapped": _swapped_labels,
    "clock_doubled": lambda sheet, rng: replace(sheet, period_s=2 * sheet.period_s),
    "commands_late": lambda sheet, rng: _late(sheet, commands=sheet.commands),
    "forces_late": lambda sheet, rng: _late(sheet, f=sheet.f),
    "tare": _tare,
    "homed_anew": _homed_anew,
    "tared_anew": _tared_anew,
}


def spoil(sheet: Sheet, names: str, rng: np.random.Generator) -> Sheet:
    """With what is wrong by these names of :data:`SPOILED`, as in ``clock_doubled+tare``."""
    for name in names.split("+"):
        sheet = SPOILED[name](sheet, rng)
    return sheet
