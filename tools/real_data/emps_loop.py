"""The authors' own model of EMPS in its loop: the yardstick. Janot, Gautier, Brunot 2019, equations 1 to 4.

    M q'' = gtau vir − Fv q' − Fc sign(q') − offset        vir = kv (kp (qg − q) − q'), |vir| ≤ 10 V, once a millisecond

Written here in full, apart from the package: no MuJoCo, an own treatment of dry friction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

KP, KV, GTAU, VOLTS, PERIOD_S = 160.18, 243.45, 35.15, 10.0, 1e-3
#: Integration steps of a period.
_SUBSTEPS = 10


@dataclass(frozen=True)
class Carriage:
    """Parameters of the carriage; the authors' by default."""

    mass: float = 95.11  #: kg
    viscous: float = 203.5  #: N·s/m
    coulomb: float = 20.39  #: N
    offset: float = -3.16  #: N


def simulate(one: Carriage, goal: np.ndarray, pulses: np.ndarray, start: float, late: int = 0) -> np.ndarray:
    """The carriage in its loop, held for a period at a time.

    Args:
      one: its parameters.
      goal: reference position, m, ``(T,)``.
      pulses: volts added at the drive, ``(T,)``.
      start: position at first, m.
      late: 0: the drive acts on the velocity itself; n: on the difference of positions n periods apart.

    Returns:
      Position, m, and the drive's voltage without pulses, V, ``(T, 2)``.
    """
    step = PERIOD_S / _SUBSTEPS
    q, v, before = start, 0.0, [start] * (late + 1)
    found = np.empty((len(goal), 2))
    for k in range(len(goal)):
        before = [q, *before[:late]]
        speed = (q - before[late]) / (late * PERIOD_S) if late else v
        control = KV * (KP * (goal[k] - q) - speed)
        volts = min(VOLTS, max(-VOLTS, control + pulses[k]))
        found[k] = q, volts - pulses[k]
        force = GTAU * volts - one.offset
        for _ in range(_SUBSTEPS):
            free = v + step * (force - one.viscous * v) / one.mass
            stop = step * one.coulomb / one.mass
            v = free - stop if free > stop else free + stop if free < -stop else 0.0
            q += step * v
    return found


def velocity_delay(position: np.ndarray, goal: np.ndarray, volts: np.ndarray) -> tuple[float, float, float]:
    """How late the drive's velocity is, from its own signals: vir = a (qg − q) − b q' + c q'', late by c/b.

    Returns:
      a and b as shares of kp·kv and kv, and the delay in seconds.
    """
    from scipy.signal import butter, sosfiltfilt

    smooth = sosfiltfilt(butter(4, 100 * 2 * PERIOD_S, output="sos"), position)
    velocity = np.gradient(smooth, PERIOD_S)
    columns = np.column_stack([goal - position, velocity, np.gradient(velocity, PERIOD_S), np.ones_like(position)])
    inner = slice(200, -200)
    (a, b, c, _), *_ = np.linalg.lstsq(columns[inner], volts[inner], rcond=None)
    return float(a / (KP * KV)), float(-b / KV), float(-c / b)
