"""The force of EMPS by linear regression: what friction its recordings have, without any simulation.

    τ = M q'' + Fv q' + Fc sign q' (+ offset) (+ d max(q', 0))

Signals are low-passed at 20 Hz, forwards and backwards; what is slower than 5 mm/s is left out.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfiltfilt

from tools.real_data.emps_loop import GTAU, PERIOD_S

CUTOFF_HZ, SLOWEST_M_S, EDGE = 20.0, 0.005, 300
#: What each equation has besides mass, viscous and dry friction.
EQUATIONS = ((), ("offset",), ("d",), ("offset", "d"))


def regress(raw: dict[str, np.ndarray], more: tuple[str, ...]) -> tuple[dict[str, float], float]:
    """Parameters by least squares, and the root mean square that they leave, N.

    Args:
      raw: a recording, with ``qm`` in m and ``vir`` in V.
      more: terms besides the first three.
    """
    low = butter(4, CUTOFF_HZ, fs=1 / PERIOD_S, output="sos")
    force = sosfiltfilt(low, GTAU * raw["vir"])
    speed = np.gradient(sosfiltfilt(low, raw["qm"]), PERIOD_S)
    terms = {"M": np.gradient(speed, PERIOD_S), "Fv": speed, "Fc": np.sign(speed)}
    terms |= {"offset": np.ones_like(speed), "d": np.maximum(speed, 0.0)}
    names = ("M", "Fv", "Fc", *more)
    fast = np.abs(speed) > SLOWEST_M_S
    fast[:EDGE] = fast[-EDGE:] = False
    columns = np.column_stack([terms[name] for name in names])[fast]
    found, *_ = np.linalg.lstsq(columns, force[fast], rcond=None)
    left = force[fast] - columns @ found
    return dict(zip(names, found.tolist(), strict=True)), float(np.sqrt(np.mean(left**2)))


def table(recordings: dict[str, dict[str, np.ndarray]]) -> list[list[str]]:
    """Every equation on every recording: header first."""
    names = ("M", "Fv", "Fc", "offset", "d")
    rows = [["recording", "M [kg]", "Fv [N·s/m]", "Fc [N]", "offset [N]", "d [N·s/m]", "left [N]"]]
    for file, raw in recordings.items():
        for more in EQUATIONS:
            found, left = regress(raw, more)
            rows.append([file, *(f"{found[n]:.4g}" if n in found else "–" for n in names), f"{left:.2f}"])
    return rows
