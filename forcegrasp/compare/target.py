"""What a model is compared with: the measured signals as one array, their noise, and the phases of the grasps."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from forcegrasp.compare.quantised import find_step
from forcegrasp.errors import MeasurementError
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet
from forcegrasp.short_repr import ShortRepr

#: The signals, in the order of every array's last axis.
SIGNALS = ("position_l", "position_r", "force_l", "force_r")
UNITS = ("m", "m", "N", "N")
PHASES = ("free", "first_contact", "both", "hold", "release")

# Rounding to steps smaller than this many σ is hidden by the noise.
_QUANTUM = 1.0
# A command that has not changed for this long is held; contact is young, or just lost, for this long. Seconds.
_HELD_S, _YOUNG_S = 0.3, 0.2


@dataclass(frozen=True, repr=False)
class Target(ShortRepr):
    """Measured signals of all grasps, padded to the longest.

    Shapes: G grasps, S samples, 4 signals (:data:`SIGNALS`).
    """

    grasps: tuple[MeasuredGrasp, ...]
    signals: np.ndarray  #: ``(G, S, 4)``; 0 where there is no sample
    mask: np.ndarray  #: which samples there are, ``(G, S)``
    sigma: np.ndarray  #: noise of each signal, in its unit, that of rounding included, ``(4,)``
    sensor_sigma: np.ndarray  #: the same without rounding, ``(4,)``
    quantum: np.ndarray  #: step that a signal's readings are multiples of, 0 if none worth noticing, ``(4,)``
    sigma_known: bool  #: whether the noise was given with the set; estimated from it otherwise
    phase: np.ndarray  #: index into :data:`PHASES`, ``(G, S)``; −1 where there is no sample

    @property
    def objects(self) -> list[str]:
        """Names of the objects, in order of appearance."""
        return list(dict.fromkeys(g.object for g in self.grasps))

    def subset(self, keep: np.ndarray) -> Target:
        """The grasps of these indices."""
        picked = tuple(self.grasps[i] for i in keep)
        longest = self.mask[keep].sum(axis=1).max()
        signals, mask, phase = (a[keep][:, :longest] for a in (self.signals, self.mask, self.phase))
        return dataclasses.replace(self, grasps=picked, signals=signals, mask=mask, phase=phase)

    def residual(self, predicted: np.ndarray) -> np.ndarray:
        """(measured − predicted) ÷ noise, ``(..., G, S, 4)``; 0 where there is no sample."""
        return np.where(self.mask[:, :, None], (self.signals - predicted) / self.sigma, 0.0)


def make_target(measured: MeasurementSet) -> Target:
    """Lines up a measurement set, estimates its noise where it is not given, and finds the phases."""
    grasps = measured.grasps
    samples = max(len(g.time_s) for g in grasps)
    signals, mask = np.zeros((len(grasps), samples, 4)), np.zeros((len(grasps), samples), bool)
    for index, grasp in enumerate(grasps):
        n = len(grasp.time_s)
        signals[index, :n] = np.concatenate([grasp.position_m, grasp.force_n], axis=1)
        mask[index, :n] = True
    given = [measured.position_std_m, measured.position_std_m, measured.force_std_n, measured.force_std_n]
    estimated = estimate_noise(grasps)
    sensor = np.array([e if g is None else g for g, e in zip(given, estimated, strict=True)], float)
    steps = [find_step(signals[..., kind][mask]) for kind in ([0, 1], [2, 3])]
    quantum = np.repeat(steps, 2)
    quantum = np.where(quantum >= _QUANTUM * sensor, quantum, 0.0)
    sigma = np.sqrt(sensor**2 + quantum**2 / 12)
    phase = np.full(mask.shape, -1)
    for index, grasp in enumerate(grasps):
        phase[index, : len(grasp.time_s)] = find_phases(grasp, sigma[2:])
    return Target(grasps, signals, mask, sigma, sensor, quantum, None not in given, phase)


def estimate_noise(grasps: tuple[MeasuredGrasp, ...]) -> np.ndarray:
    """Sensor noise of each signal from its third differences, where the command is held; ``(4,)``.

    Third differences of a smooth signal vanish and those of white noise have variance 20 σ². A finger's two signals of
    one kind share one figure. Without repeated grasps this is a lower bound: noise that is slow looks like motion.

    Raises:
      MeasurementError: if a signal does not vary at all, or nothing is long enough.
    """
    differences: list[np.ndarray] = []
    for grasp in grasps:
        third, held = third_differences(grasp, np.concatenate([grasp.position_m, grasp.force_n], axis=1))
        differences.append(third[held] if held.sum() > 5 else third)
    third = np.concatenate(differences)
    sigma = []
    for pair, kind in ((slice(0, 2), "positions"), (slice(2, 4), "forces")):
        values = third[:, pair].ravel()
        robust = 1.4826 * np.median(np.abs(values)) if len(values) else 0.0
        estimate = (robust if robust > 0 else np.sqrt(np.mean(values**2)) if len(values) else 0.0) / np.sqrt(20)
        if not estimate > 0:
            raise MeasurementError(
                f"the noise of the {kind} can't be told from the data: give position_std_m and force_std_n in meta.yaml"
            )
        sigma += [estimate, estimate]
    return np.array(sigma)


def third_differences(grasp: MeasuredGrasp, signals: np.ndarray, stride: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Third differences ``(n, k)`` of signals ``(T, k)``, and in which of them the command is held, ``(n,)``.

    A difference is taken over samples that are ``stride`` apart.
    """
    for _ in range(3):
        signals = signals[stride:] - signals[:-stride]
    time, reach = grasp.time_s, 3 * stride
    return signals, _held_for(grasp)[reach:] >= _HELD_S + time[reach:] - time[:-reach]


def find_phases(grasp: MeasuredGrasp, force_std_n: np.ndarray) -> np.ndarray:
    """Phase of each sample, as an index into :data:`PHASES`, ``(T,)``, from the measured data alone."""
    touching = contacts(grasp, force_std_n)
    time, any_touch, both = grasp.time_s, np.any(touching, axis=1), np.all(touching, axis=1)
    held = _held_for(grasp) >= _HELD_S
    opening = np.zeros(len(time), bool)
    change = np.diff(grasp.command_m.mean(axis=1), prepend=grasp.command_m[0].mean())
    last = 0.0
    for index, step in enumerate(change):  # the direction of the last change of the command
        last = step if step != 0 else last
        opening[index] = last > 0
    phase = np.where(both & held, PHASES.index("hold"), PHASES.index("both"))
    since_both = _time_since_start(time, both)
    phase[any_touch & (~both | (since_both < _YOUNG_S))] = PHASES.index("first_contact")
    phase[~any_touch] = PHASES.index("free")
    recently = _time_since_end(time, any_touch) < _YOUNG_S
    leaving = opening & ((any_touch & ~(both & held)) | (~any_touch & recently))
    phase[leaving] = PHASES.index("release")
    return phase


def contacts(grasp: MeasuredGrasp, force_std_n: np.ndarray) -> np.ndarray:
    """Which finger touches, by its force beyond what it reads in free air, ``(T, 2)``."""
    start = grasp.force_n[: max(3, min(8, len(grasp.force_n) // 10))]
    level = np.median(start, axis=0)
    return grasp.force_n - level > 5 * force_std_n


def _held_for(grasp: MeasuredGrasp) -> np.ndarray:
    """Seconds since the command last changed, ``(T,)``."""
    changed = np.r_[True, np.any(np.diff(grasp.command_m, axis=0) != 0, axis=1)]
    return grasp.time_s - grasp.time_s[np.maximum.accumulate(np.where(changed, np.arange(len(changed)), 0))]


def _time_since_start(time: np.ndarray, on: np.ndarray) -> np.ndarray:
    """Seconds since ``on`` last became true; infinite where it is not."""
    starts = on & ~np.r_[False, on[:-1]]
    index = np.maximum.accumulate(np.where(starts, np.arange(len(on)), -1))
    return np.where(on, time - time[np.maximum(index, 0)], np.inf)


def _time_since_end(time: np.ndarray, on: np.ndarray) -> np.ndarray:
    """Seconds since ``on`` was last true; infinite before."""
    index = np.maximum.accumulate(np.where(on, np.arange(len(on)), -1))
    return np.where(index >= 0, time - time[np.maximum(index, 0)], np.inf)
