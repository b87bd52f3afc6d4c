"""Noise of the sensors, as far as readings show it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.identify.phases import HELD_S, held_for
from forcegrasp.measure.schema import MeasuredGrasp


def estimate_noise(grasps: Sequence[MeasuredGrasp], kinds: Mapping[str, slice]) -> np.ndarray:
    """Sensor noise of each signal from its third differences, where the command is held; ``(C,)``.

    Third differences of a smooth signal vanish and those of white noise have variance 20 σ². Channels of one kind
    share one figure. Without repeated grasps this is a lower bound: noise that is slow looks like motion.

    Args:
      grasps: that were measured.
      kinds: which signals are of one kind.

    Raises:
      MeasurementError: if a signal does not vary at all, or nothing is long enough.
    """
    differences: list[np.ndarray] = []
    for grasp in grasps:
        third, held = third_differences(grasp, np.concatenate([grasp.position_m, grasp.force_n], axis=1))
        differences.append(third[held] if held.sum() > 5 else third)
    third = np.concatenate(differences)
    sigma = np.zeros(third.shape[1])
    for kind, part in kinds.items():
        values = third[:, part].ravel()
        robust = 1.4826 * np.median(np.abs(values)) if len(values) else 0.0
        estimate = (robust if robust > 0 else np.sqrt(np.mean(values**2)) if len(values) else 0.0) / np.sqrt(20)
        if not estimate > 0:
            raise MeasurementError(
                f"the noise of the {kind}s can't be told from the data:"
                " give position_std_m and force_std_n in meta.yaml"
            )
        sigma[part] = estimate
    return sigma


def third_differences(grasp: MeasuredGrasp, signals: np.ndarray, stride: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Third differences ``(n, k)`` of signals ``(T, k)``, and in which of them the command is held, ``(n,)``.

    A difference is taken over samples that are ``stride`` apart.
    """
    for _ in range(3):
        signals = signals[stride:] - signals[:-stride]
    time, reach = grasp.time_s, 3 * stride
    return signals, held_for(grasp)[reach:] >= HELD_S + time[reach:] - time[:-reach]
