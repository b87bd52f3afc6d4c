"""Effects on signals, and a grasp that has come to rest: what tests of equations have in common."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
from scipy.signal import butter, cont2discrete, dlsim, lti

from forcegrasp.effects import Effect, get_effect

from .rollouts import make_plant, start

DT = 0.002
T = np.arange(1000) * DT
GAIN = 100.0  # N/m, of the servo
TOUCH_M = 0.025  # where a pad meets the nominal object


def make(name: str, *values: float, variant: str = "") -> Effect:
    return get_effect(name)(np.array([values]), DT, variant)


def butterworth(signal: np.ndarray, tau: float) -> np.ndarray:
    """SciPy's filter of second order with the corner 1/(2πτ), of a signal that stays for a step; at rest at first."""
    return filtered(signal, *butter(2, 1 / tau, analog=True))


def filtered(signal: np.ndarray, over: Sequence[float], under: Sequence[float]) -> np.ndarray:
    """What SciPy makes of a signal that stays for a step, by a transfer function; at rest at first."""
    system = lti(over, under).to_ss()
    held = cont2discrete((system.A, system.B, system.C, system.D), DT, method="zoh")
    _, out, _ = dlsim((*held[:4], DT), np.append(signal - signal[0], 0.0))
    return signal[0] + out[1:, 0]


def read(effect: Effect, left: np.ndarray, right: np.ndarray | None = None) -> np.ndarray:
    """Force readings of a signal, ``(samples, 2)``."""
    both = np.stack([left, left if right is None else right], axis=1)
    return np.array([effect.read_force(f[None])[0] for f in both])


def send(effect: Effect, command: np.ndarray, position: np.ndarray | float = 0.0, every: int = 1) -> np.ndarray:
    """What the actuator gets of the commands, ``(samples,)``, a new one every so many steps."""
    position = np.broadcast_to(position, command.shape)
    out = []
    for i, u in enumerate(command):
        q = np.full((1, 2), position[i])
        stub = SimpleNamespace(position=q, measured_position=q, recorded_position=None)
        effect.attach(stub, np.array([0]))
        out.append(effect.command(np.full((1, 2), u), np.array([i % every == 0]))[0, 0])
    return np.array(out)


def wave(f: float = 1.3) -> np.ndarray:
    return np.sin(2 * np.pi * f * T) + 0.3 * np.sin(2 * np.pi * 3.1 * f * T)


def settle(name: str, values: tuple[float, ...], *targets: float, variant: str = "", seconds: float = 1.6, **more):
    """Steps from one target to the next on the reference tier; the plant as it rests at the last."""
    plant = make_plant(1, [(get_effect(name), values, variant, [0])] if name else [], "reference")
    start(plant, [0], np.zeros(1))
    for target in targets:
        plant.advance(np.full((1, 2), target), round(seconds / plant.dt))
    return plant
