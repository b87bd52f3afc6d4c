"""Is a measurement set what its author meant? It is read and checked; nothing is simulated or fitted."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from forcegrasp.doctor.finding import Finding, fine, mend, note, warning
from forcegrasp.errors import ConfigError, MeasurementError
from forcegrasp.short_repr import counted

if TYPE_CHECKING:
    from forcegrasp.measure import MeasurementSet
    from forcegrasp.physics import Gripper

_PAGE = "see docs/compare-your-data.md"
# Share of their distance by which rows scatter before that is told.
_UNEVEN = 0.05
# Times its clock's standard deviation by which a set's commands may be slower or faster than the gripper takes them.
_CLOCK = 3.0


def check_data(path: str) -> Iterator[Finding]:
    """What a measurement set holds, in the user's units, and what is wrong or odd in it.

    Args:
      path: the set's folder.
    """
    from forcegrasp.identify.loading import load
    from forcegrasp.measure import MeasurementSet

    try:
        loaded = load(path)
    except (MeasurementError, ConfigError) as error:
        yield mend("set", str(error), _PAGE)
        return
    yield fine("set", loaded.measured.summary())
    if isinstance(loaded.measured, MeasurementSet):
        yield from _readings(loaded.measured, loaded.gripper)
    for told in loaded.warnings:
        yield warning("set", told, "look whether it is meant so")


def _readings(measured: MeasurementSet, gripper: Gripper) -> Iterator[Finding]:
    import numpy as np

    rows = sum(len(grasp.time_s) for grasp in measured.grasps)
    steps = 1e3 * np.concatenate([np.diff(grasp.time_s) for grasp in measured.grasps])
    apart, (least, most) = np.median(steps), np.quantile(steps, (0.01, 0.99))
    uneven = f" (from {least:.3g} to {most:.3g})" if most - least > _UNEVEN * apart else ""
    sessions = counted(len({grasp.session for grasp in measured.grasps}), "session")
    told = f"{rows} in {sessions}, {apart:.3g} ms apart{uneven}; columns {', '.join(measured.columns.signals)}"
    if uneven:
        remedy = "look whether rows are stamped when they are read, and not when they are written"
        yield note("rows", f"{told}; uneven stamps", remedy)
    else:
        yield fine("rows", told)
    yield from _clock(measured, gripper)
    if masses := [grasp.mass_kg for grasp in measured.grasps if grasp.mass_kg is not None]:
        yield fine("masses", f"of objects are given in {len(masses)} grasps: {min(masses):.3g} to {max(masses):.3g} kg")
    for name, value, channels in (
        ("positions", measured.position_std_m, gripper.positions),
        ("forces", measured.force_std_n, gripper.forces),
    ):
        if value is not None:
            yield fine("noise", f"of {name} is given: {value:.3g} {channels[0].unit}")
        elif channels:
            yield note("noise", f"of {name} is not given: it is estimated from the readings")


def _clock(measured: MeasurementSet, gripper: Gripper) -> Iterator[Finding]:
    """Whether commands come as often as the gripper takes them; where they are far from that, the set warns itself."""
    from forcegrasp.measure.check_givens import clock_factor

    share = measured.period_std_share
    factor = clock_factor(measured, gripper.period_s, 1 + _CLOCK * share)
    if factor is not None and clock_factor(measured, gripper.period_s) is None:
        apart = f"commands are {1e3 * factor * gripper.period_s:.4g} ms apart, and the gripper takes one every"
        beyond = f"beyond {_CLOCK:g} times the period_std_share of {share:g}"
        told = f"{apart} {1e3 * gripper.period_s:g} ms: {factor - 1:+.1%}, {beyond}"
        yield note("clock", told, "is it the clock of the rows that is off, or control.period_s of the description?")
