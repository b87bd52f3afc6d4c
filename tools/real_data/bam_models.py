"""The friction models M1 … M6 of BAM (Duclusaud et al. 2024, arXiv 2410.08650) on a servo with a pendulum: a yardstick.

Written here in full, apart from the package: voltage u = V clip(g kp (goal − q), ±1), motor torque
τm = k u/R − k² q'/R, gravity τe = −m g l sin q, and dry friction that is at most,
s = exp(−|q'/v_s|^α) being how much of a stop there is,

    M1  Kc                          M2  M1 + s Kc'                M3  M1 + Kl |τe − τm|
    M4  M2 + (Kl + s Kl') |τe − τm|
    M5  M2 + |Ke τe − Km τm| + s |Ke' τe − Km' τm|               (backdriving and driving apart)
    M6  M5 + s (Qe τe² where |τe| < |τm|, else Qm τm²) where both work against each other

plus Kv |q'| in each: what stops the shaft in a step is used up to that much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

GRAVITY = 9.80665
#: Duty cycle per kp and radian of an XL330: counts per radian over (256 · 885), as BAM has it.
ERROR_GAIN = 4096 / (2 * np.pi) / (256 * 885)
STEP_S, _SUBSTEPS = 0.005, 2
_MOTOR = {"k": (0.4, 0.1, 3.0), "R": (2.6, 1.0, 12.0), "armature": (0.005, 1e-4, 0.05), "q0": (0.0, -0.1, 0.1)}
_PLAIN = {"Kc": (0.02, 0.0, 0.2), "Kv": (0.02, 0.0, 1.0)}
_STOP = {"v_s": (0.3, 0.02, 3.0), "alpha": (1.35, 0.5, 10.0), "Kc'": (0.02, 0.0, 0.2)}
_LOAD = {"Kl": (0.05, 0.0, 0.5)}
_SIDES = {"Km": (0.05, 0.0, 0.5), "Ke": (0.05, 0.0, 0.5), "Km'": (0.05, 0.0, 1.0), "Ke'": (0.05, 0.0, 1.0)}
#: Parameters of each model: start, least, most.
MODELS: dict[str, dict[str, tuple[float, float, float]]] = {
    "M1": _MOTOR | _PLAIN,
    "M2": _MOTOR | _PLAIN | _STOP,
    "M3": _MOTOR | _PLAIN | _LOAD,
    "M4": _MOTOR | _PLAIN | _STOP | _LOAD | {"Kl'": (0.05, 0.0, 1.0)},
    "M5": _MOTOR | _PLAIN | _STOP | _SIDES,
    "M6": _MOTOR | _PLAIN | _STOP | _SIDES | {"Qm": (0.0, 0.0, 0.5), "Qe": (0.0, 0.0, 0.5)},
}
#: Which simpler ones each contains.
CONTAINS = {"M1": (), "M2": ("M1",), "M3": ("M1",), "M4": ("M2", "M3"), "M5": ("M4",), "M6": ("M5",)}


@dataclass(frozen=True)
class Logs:
    """Logs on one grid of 5 ms. L logs, T instants."""

    names: tuple[str, ...]
    goal: np.ndarray  #: rad, ``(L, T)``
    enabled: np.ndarray  #: ``(L, T)``
    position: np.ndarray  #: rad, ``(L, T)``
    kp: np.ndarray  #: ``(L,)``
    volts: np.ndarray  #: ``(L,)``
    mass: np.ndarray  #: kg, ``(L,)``
    length: np.ndarray  #: m, ``(L,)``

    def chosen(self, names: Sequence[str]) -> Logs:
        """The logs of these names."""
        keep = [self.names.index(name) for name in names]
        arrays = (getattr(self, key)[keep] for key in ("goal", "enabled", "position", "kp", "volts", "mass", "length"))
        return Logs(tuple(names), *arrays)


def on_a_grid(name: str, log: dict) -> dict[str, np.ndarray]:
    """Goal, position and switch of a log every 5 ms."""
    rows = log["entries"]
    time = np.array([row["timestamp"] for row in rows])
    grid = np.arange(time[0], time[-1], STEP_S)
    held = np.searchsorted(time, grid, side="right") - 1
    goal, position = (np.array([row[key] for row in rows], float) for key in ("goal_position", "position"))
    enabled = np.array([row["torque_enable"] for row in rows], float)
    return {"goal": goal[held], "enabled": enabled[held], "position": np.interp(grid, time, position)}


def read_logs(logs: dict[str, dict]) -> Logs:
    """Logs as BAM writes them, by name, cut to the length of the shortest."""
    grids = [on_a_grid(name, log) for name, log in logs.items()]
    least = min(len(grid["goal"]) for grid in grids)
    stacked = (np.stack([grid[key][:least] for grid in grids]) for key in ("goal", "enabled", "position"))
    facts = (np.array([float(log[key]) for log in logs.values()]) for key in ("kp", "vin", "mass", "length"))
    return Logs(tuple(logs), *stacked, *facts)


def simulate(model: str, values: np.ndarray, logs: Logs) -> np.ndarray:
    """Positions of all logs under many parameter sets at once, ``(P, L, T)``; ``values``: ``(P, parameters)``."""
    names = list(MODELS[model])
    p = {name: values[:, names.index(name), None] for name in names}
    step = STEP_S / _SUBSTEPS
    inertia = logs.mass * logs.length**2 + p["armature"]
    q = np.repeat(logs.position[None, :, 0], len(values), axis=0)
    v = np.zeros_like(q)
    found = np.empty((*q.shape, logs.goal.shape[1]))
    for k in range(logs.goal.shape[1]):
        found[..., k] = q
        for _ in range(_SUBSTEPS):
            duty = np.clip(ERROR_GAIN * logs.kp * (logs.goal[:, k] - q), -1.0, 1.0)
            motor = (p["k"] * logs.volts * duty - p["k"] ** 2 * v) / p["R"] * logs.enabled[:, k]
            load = -logs.mass * GRAVITY * logs.length * np.sin(q + p["q0"])
            most = _friction(p, motor, load, v) + p["Kv"] * np.abs(v)
            stop = inertia / step * v + motor + load
            v = v + step * (motor + load - np.sign(stop) * np.minimum(np.abs(stop), most)) / inertia
            q = q + step * v
    return found


def _friction(p: dict[str, np.ndarray], motor: np.ndarray, load: np.ndarray, v: np.ndarray) -> np.ndarray:
    found = p["Kc"] + np.zeros_like(v)
    stop = np.exp(-(np.abs(v / p["v_s"]) ** p["alpha"])) if "v_s" in p else np.zeros_like(v)
    if "Kc'" in p:
        found = found + stop * p["Kc'"]
    if "Kl" in p:
        found = found + (p["Kl"] + stop * p.get("Kl'", 0.0)) * np.abs(load - motor)
    if "Km" in p:
        found = found + np.abs(p["Ke"] * load - p["Km"] * motor)
        found = found + stop * np.abs(p["Ke'"] * load - p["Km'"] * motor)
    if "Qm" in p:
        weaker = np.where(np.abs(load) < np.abs(motor), p["Qe"] * load**2, p["Qm"] * motor**2)
        found = found + stop * weaker * (np.sign(load) != np.sign(motor))
    return found


def fit_all(logs: Logs) -> dict[str, dict[str, float]]:
    """All models, each from the nominal parameters and from the models that it contains."""
    fitted: dict[str, dict[str, float]] = {}
    for model, inside in CONTAINS.items():
        starts = [{}, *(_as_in(fitted[name]) for name in inside)]
        fitted[model] = min((_fit(model, logs, start) for start in starts), key=lambda pair: pair[0])[1]
    return fitted


def _as_in(simpler: dict[str, float]) -> dict[str, float]:
    """Parameters of a model in one that contains it: load counts alike on both sides, what is new does nothing."""
    none = dict.fromkeys(("Kc'", "Kl", "Kl'", "Km", "Ke", "Km'", "Ke'", "Qm", "Qe"), 0.0)
    sides = {side + dash: simpler.get("Kl" + dash, 0.0) for side in ("Km", "Ke") for dash in ("", "'")}
    return none | sides | simpler


def _fit(model: str, logs: Logs, start: dict[str, float]) -> tuple[float, dict[str, float]]:
    entries = MODELS[model]
    low, high = (np.array([entry[i] for entry in entries.values()]) for i in (1, 2))
    width = high - low
    first = np.array([start.get(name, entry[0]) for name, entry in entries.items()])
    found = least_squares(
        lambda x: (simulate(model, x[None], logs)[0] - logs.position).ravel(),
        np.clip(first, low + 1e-4 * width, high - 1e-4 * width),
        _slopes(model, logs, width),  # pyright: ignore[reportArgumentType]  # scipy is not annotated
        bounds=(low, high), x_scale=width, max_nfev=25,
    )  # fmt: skip
    return float(found.cost), dict(zip(entries, found.x.tolist(), strict=True))


def _slopes(model: str, logs: Logs, width: np.ndarray):
    def slopes(x: np.ndarray) -> np.ndarray:
        move = 2e-3 * width * np.where(x + 2e-3 * width < x.clip(0) + width, 1, -1)
        moved = simulate(model, np.concatenate([x[None], x + np.diag(move)]), logs).reshape(len(x) + 1, -1)
        return ((moved[1:] - moved[0]) / move[:, None]).T

    return slopes


def rms(model: str, values: dict[str, float], logs: Logs) -> float:
    """Root mean square of the positions, rad."""
    return float(np.sqrt(np.mean((simulate(model, np.array([list(values.values())]), logs)[0] - logs.position) ** 2)))
