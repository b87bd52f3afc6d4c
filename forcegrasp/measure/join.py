"""Joins sets of one gripper, so that they are compared and fitted as one."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.measure.check_givens import command_period_s, same_clock
from forcegrasp.measure.folder import show
from forcegrasp.measure.schema import TOLERANCES, FinalForceTable, MeasurementSet, fingerprint_of_parts

Measured = TypeVar("Measured", bound=MeasurementSet | FinalForceTable)

# What must be said alike of all sets, besides the gripper.
_SAME = ("position_std_m", "force_std_n", *(name for name, _ in TOLERANCES.values()))
# An object's radius may differ between sets by so many standard deviations of its difference.
_TOLERANCE = 3 * 2**0.5


def join(sets: Sequence[Measured], gripper: str) -> Measured:
    """Several sets of one kind as one; an object that several have is the same object, and sessions are their own.

    Names of grasps and sessions that several sets have are told apart by the set's name.

    Args:
      sets: two at least, each with its folder as ``path``; the result's is all of them, as ``data=`` takes it.
      gripper: the name or path of theirs.

    Raises:
      MeasurementError: if a set is there twice, or they are of several kinds, give another noise, or another radius of
        an object.
    """
    first, labels = sets[0], _labels(sets)
    for index, one in enumerate(sets):
        for other in sets[:index]:
            if one.fingerprint == other.fingerprint:
                raise MeasurementError(f"{show(one.path)}: holds the same as {show(other.path)}; give each set once")
        if _kind(one) != _kind(first):
            kinds = f"is of kind {_kind(one)}, {show(first.path)} of kind {_kind(first)}"
            raise MeasurementError(f"{show(one.path)}: {kinds}; only sets of one kind can be joined")
        for key in _SAME:
            given, before = getattr(one, key, None), getattr(first, key, None)
            if given != before:
                values = f"{_told(given)}, in {show(first.path)} {_told(before)}"
                raise MeasurementError(f"{show(one.path / 'meta.yaml')}: {key} is {values}; give the same to join them")
    facts = {
        "path": Path(f"[{','.join(str(one.path) for one in sets)}]"),
        "name": " + ".join(labels),
        "gripper": gripper,
        "source": "; ".join(dict.fromkeys(one.source for one in sets)),
        "license": "; ".join(dict.fromkeys(one.license for one in sets)),
    }
    if isinstance(first, FinalForceTable):
        return dataclasses.replace(first, **facts, **_rows([s for s in sets if isinstance(s, FinalForceTable)], labels))
    return dataclasses.replace(first, **facts, **_grasps([s for s in sets if isinstance(s, MeasurementSet)], labels))


def parts_of(joined: MeasurementSet, sets: Sequence[MeasurementSet]) -> list[MeasurementSet]:
    """The sets that were joined, with the names that they and their grasps have in the joined one."""
    ends = np.cumsum([len(one.grasps) for one in sets])[:-1].tolist()
    grasps = [joined.grasps[low:high] for low, high in zip([0, *ends], [*ends, None], strict=True)]
    named = zip(sets, _labels(sets), grasps, strict=True)
    return [dataclasses.replace(one, name=label, grasps=own) for one, label, own in named]


def _labels(sets: Sequence[Measured]) -> list[str]:
    names = [one.name for one in sets]
    return [one.name if names.count(one.name) == 1 else str(one.path) for one in sets]


def _grasps(sets: Sequence[MeasurementSet], labels: Sequence[str]) -> dict[str, object]:
    _check_radii(sets)
    grasp_names = _told_apart([[g.name for g in one.grasps] for one in sets], labels)
    sessions = _told_apart([[g.session for g in one.grasps] for one in sets], labels)
    grasps = tuple(
        dataclasses.replace(grasp, name=name, session=session)
        for one, *new in zip(sets, grasp_names, sessions, strict=True)
        for grasp, name, session in zip(one.grasps, *new, strict=True)
    )
    fingerprint = fingerprint_of_parts((one.fingerprint for one in sets), (grasp.name for grasp in grasps))
    notes = _notes([{g.object for g in s.grasps} for s in sets]) + _contradictions(sets, labels)
    return {"grasps": grasps, "fingerprint": fingerprint, "notes": notes}


def _rows(tables: Sequence[FinalForceTable], labels: Sequence[str]) -> dict[str, object]:
    named = [one.sessions or (label,) * len(one.objects) for one, label in zip(tables, labels, strict=True)]
    sessions = [name for own in _told_apart(named, labels) for name in own]
    return {
        "objects": tuple(name for one in tables for name in one.objects),
        "delta_q_m": np.concatenate([one.delta_q_m for one in tables]),
        "final_force_n": np.concatenate([one.final_force_n for one in tables]),
        "sessions": tuple(sessions),
        "fingerprint": fingerprint_of_parts((one.fingerprint for one in tables), sessions),
        "notes": _notes([set(one.objects) for one in tables]),
    }


def _check_radii(sets: Sequence[MeasurementSet]) -> None:
    """Raises MeasurementError about objects of one name that can't be one object."""
    known: dict[str, list[tuple[float, Path]]] = {}
    for one in sets:
        own: dict[str, list[float]] = {}
        for grasp in one.grasps:
            own.setdefault(grasp.object, []).extend([] if grasp.radius_m is None else [grasp.radius_m])
        for name, radii in own.items():
            before = known.get(name, [])
            pairs = [(abs(r - other), r, other, path) for r in radii for other, path in before]
            apart, radius, other, path = min(pairs, default=(0.0, 0.0, 0.0, one.path))
            if apart > _TOLERANCE * one.radius_std_m:
                place = f"{show(one.path / 'grasps.csv')}: {show(name)}"
                sizes = f"a radius of {1e3 * radius:.4g} mm, in {show(path)} {1e3 * other:.4g} mm"
                raise MeasurementError(f"{place} has {sizes}; give another object another name")
        for name, radii in own.items():
            known.setdefault(name, []).extend((radius, one.path) for radius in set(radii))


def _contradictions(sets: Sequence[MeasurementSet], labels: Sequence[str]) -> tuple[str, ...]:
    """What one set says and another does not, or says otherwise, though it may be right."""
    found = []
    for name in dict.fromkeys(g.object for one in sets for g in one.grasps if g.object):
        having = {label: [g.radius_m for g in one.grasps if g.object == name]
                  for one, label in zip(sets, labels, strict=True)}  # fmt: skip
        without = [label for label, radii in having.items() if radii and None in radii]
        given = [label for label, radii in having.items() if radii and None not in radii]
        if without and given:
            found.append(
                f"{without[0]}: gives no radius of {show(name)}, {given[0]} does; give it in both, or it is fitted"
            )
    periods = {label: command_period_s(one) for one, label in zip(sets, labels, strict=True) if one.kind == "grasps"}
    known = {label: period for label, period in periods.items() if period is not None}
    first = next(iter(known), "")
    for label, period in known.items():
        if not same_clock(period, known[first]):
            apart = f"commands are {period:.3g} s apart, in {first} {known[first]:.3g} s"
            found.append(f"{label}: {apart}; are time stamps of one too long? else the gripper is commanded unlike")
    return tuple(found)


def _told_apart(names: Sequence[Sequence[str]], labels: Sequence[str]) -> list[list[str]]:
    """The names of each set, those that several sets have with the set's label."""
    sets_with = Counter(name for own in names for name in set(own))
    return [
        [f"{name} of {label}" if sets_with[name] > 1 else name for name in own]
        for own, label in zip(names, labels, strict=True)
    ]


def _notes(objects: Sequence[set[str]]) -> tuple[str, ...]:
    common = sorted(name for name, sets in Counter(n for own in objects for n in own if n).items() if sets > 1)
    return (f"taken for the same object where several sets have it: {', '.join(map(show, common))}",) if common else ()


def _kind(one: MeasurementSet | FinalForceTable) -> str:
    return one.kind if isinstance(one, MeasurementSet) else "final_force"


def _told(value: float | None) -> str:
    return "not given" if value is None else f"{value:g}"
