"""A delay of whole rows may be of the log and not of the gripper: readings written a row late look just like it."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.diagnosis.faults.fault import Fault, besides
from forcegrasp.diagnosis.result import Diagnosis, kept_steps
from forcegrasp.identify.intervals import intervals, standard_errors
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.verdict import Verdict
from forcegrasp.measure import MeasurementSet
from forcegrasp.short_repr import counted

# What is written how, if the gripper has no such delay.
_WRITTEN = {
    "force_delay": "forces are written {rows} late",
    "readout_skew": "positions are written {rows} late",
    "command_delay": "commands are written {rows} early, or all readings {rows} late",
}


def may_be_late_rows(found: Diagnosis, loaded: Loaded[MeasurementSet]) -> Diagnosis:
    """The diagnosis with a delay that is one of whole rows tied with a log whose rows are late; as it was otherwise.

    Both leave the same readings, so that no data of this log tell them apart.

    Args:
      found: a diagnosis.
      loaded: the set.
    """
    moved = found.fault if found.fault is not None and found.fault.moved is not None else None  # it is no fault
    if loaded.gripper.is_servo or found.fault is not moved or not found.verdict.names_effects:
        return found
    named = {step.effects[0] for step in kept_steps(found.steps)}
    for name in _WRITTEN:
        rows = whole_rows(found, name) if name in named else 0
        if rows:
            words = _WRITTEN[name].format(rows=counted(rows, "row"))
            check = "in which row each column is written, and in which it was read or commanded"
            fault = besides(Fault("late_row", words, check, loaded, instead_of=name), moved)
            return dataclasses.replace(found, verdict=Verdict.ONE_OF, effects=(*found.effects, fault.name), fault=fault)
    return found


def row_s(found: Diagnosis) -> float:
    """Time between two rows of the set, seconds."""
    return float(np.median(np.concatenate([np.diff(grasp.time_s) for grasp in found.target.grasps])))


def whole_rows(found: Diagnosis, name: str) -> int:
    """How many rows of the set an effect's delay is, if that is within its interval and a physics step; 0 otherwise."""
    fit, gripper = found.fit, found.target.gripper
    which = next(k for k, setting in enumerate(fit.problem.effects) if setting.effect.name == name)
    _, low, high = intervals(fit, standard_errors(fit, found.target, found.numerical))[fit.problem.first_entry(which)]
    step = gripper.compile().opt.timestep
    row = row_s(found)
    rows = round((low + high) / 2 / row)
    return rows if low - step <= rows * row <= high + step else 0
