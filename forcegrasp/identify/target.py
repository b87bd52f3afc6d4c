"""What a model is compared with: the measured signals as one array, their noise, and the phases of the grasps."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.quantisation import Quantisation
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.phases import find_phases, phases_of
from forcegrasp.identify.sensor_noise import estimate_noise
from forcegrasp.identify.signal_axis import SignalAxis
from forcegrasp.identify.windows import cut
from forcegrasp.measure.rounding import find_step
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet
from forcegrasp.physics.gripper import SKEW, Gripper
from forcegrasp.short_repr import ShortRepr

# Rounding to steps smaller than this many σ is hidden by the noise.
_QUANTUM = 1.0
# No model of a servo is held against its readings more finely than this share of their range.
_FINEST = 1e-4


@dataclass(frozen=True, eq=False, repr=False)
class Target(ShortRepr):
    """Measured signals of all grasps, padded to the longest.

    Shapes: G grasps, S samples, C channels: positions, one per motor, and then forces.
    """

    grasps: tuple[MeasuredGrasp, ...]
    signals: np.ndarray  #: ``(G, S, C)``; 0 where there is no sample
    mask: np.ndarray  #: which samples there are, ``(G, S)``
    sigma: np.ndarray  #: noise of each signal, in its unit, that of rounding included, ``(C,)``
    sensor_sigma: np.ndarray  #: the same without rounding, ``(C,)``
    quantum: np.ndarray  #: step that a signal's readings are multiples of, 0 if none worth noticing, ``(C,)``
    sigma_known: bool  #: whether the noise was given with the set; estimated from it otherwise
    phase: np.ndarray  #: index into :attr:`phases`, ``(G, S)``; −1 where there is no sample
    gripper: Gripper  #: whose channels they are
    weight: np.ndarray  #: by which each grasp's residuals count in a fit, ``(G, 1, 1)``; see :mod:`.weights`

    @property
    def axis(self) -> SignalAxis:
        """The names of the channels, and which of them are positions and forces."""
        return SignalAxis(self.gripper)

    @property
    def part(self) -> str:
        """What one of its grasps is called: a "grasp", or a "window" of a servo's recording."""
        return "window" if self.gripper.is_servo else "grasp"

    @property
    def recordings(self) -> dict[str, np.ndarray]:
        """Indices of the windows of each of a servo's recordings; of grasps, which are judged one by one, none."""
        names = [grasp.session for grasp in self.grasps] if self.gripper.is_servo else []
        return {name: np.flatnonzero(np.array(names) == name) for name in dict.fromkeys(names)}

    @property
    def phases(self) -> tuple[str, ...]:
        """Names of the phases."""
        return phases_of(self.gripper)

    @property
    def readings(self) -> int:
        """Number of readings of all channels."""
        return int(self.mask.sum()) * self.signals.shape[-1]

    @property
    def rounding(self) -> EffectSetting | None:
        """Quantisation with the steps that readings come in; None if they come in none, or noise hides them."""
        if not self.quantum.any():
            return None
        steps = [self.quantum[part].max(initial=0.0) for part in (self.axis.positions, self.axis.forces)]
        return EffectSetting(effect_of(Quantisation.name, self.gripper), "", np.array(steps))

    @property
    def is_new(self) -> np.ndarray:
        """Which samples' readings may say more than the one before, ``(G, S, C)``.

        While nothing moves a rounded reading stays as it is, and is off by the same: a hold is off once.
        """
        changes = np.diff(self.signals, axis=1, prepend=np.nan) != 0
        return changes | (self.quantum == 0)

    def before_rounding(self, residual: np.ndarray) -> np.ndarray:
        """Residuals ÷ noise, as a model has them that takes what rounding adds to the noise for an error."""
        return residual * (self.sigma / self.sensor_sigma)

    @property
    def objects(self) -> list[str]:
        """Names of the objects, in order of appearance."""
        return list(dict.fromkeys(g.object for g in self.grasps))

    def subset(self, keep: np.ndarray) -> Target:
        """The grasps of these indices."""
        picked = tuple(self.grasps[i] for i in keep)
        longest = max(len(grasp.time_s) for grasp in picked)
        signals, mask, phase = (a[keep][:, :longest] for a in (self.signals, self.mask, self.phase))
        weight = self.weight[keep]
        return dataclasses.replace(self, grasps=picked, signals=signals, mask=mask, phase=phase, weight=weight)

    def residual(self, predicted: np.ndarray) -> np.ndarray:
        """(measured − predicted) ÷ noise, ``(..., G, S, C)``; 0 where there is no sample."""
        return np.where(self.mask[:, :, None], (self.signals - predicted) / self.sigma, 0.0)

    def change(self, predicted: np.ndarray, before: np.ndarray | float) -> np.ndarray:
        """What one prediction differs from another by ÷ noise, ``(..., G, S, C)``; 0 where there is no sample."""
        return np.where(self.mask[:, :, None], (predicted - before) / self.sigma, 0.0)

    @property
    def cost_of_noise(self) -> float:
        """The weighted sum of squares that noise alone leaves."""
        return float(np.sum(self.mask[..., None] * self.weight**2)) * self.signals.shape[-1]

    def beyond_noise(self, residual: np.ndarray) -> float:
        """The weighted sum of squares of residuals ÷ noise ``(G, S, C)``, less what noise alone leaves."""
        return float(np.sum((self.weight * residual) ** 2)) - self.cost_of_noise


def make_target(measured: MeasurementSet, gripper: Gripper) -> Target:
    """Lines up a measurement set, estimates its noise where it is not given, and finds the phases."""
    axis = SignalAxis(gripper)
    grasps = cut(measured.grasps, gripper.parameters.get(SKEW)) if gripper.is_servo else measured.grasps
    samples = max(len(g.time_s) for g in grasps)
    signals, mask = np.zeros((len(grasps), samples, len(axis))), np.zeros((len(grasps), samples), bool)
    for index, grasp in enumerate(grasps):
        n = len(grasp.time_s)
        signals[index, :n] = np.concatenate([grasp.position_m, grasp.force_n], axis=1)
        mask[index, :n] = True if grasp.counts is None else grasp.counts
    stds = {"position": measured.position_std_m, "force": measured.force_std_n}
    given = [stds[kind] for kind, part in axis.kinds.items() for _ in range(part.start, part.stop)]
    finest = _FINEST * np.ptp(signals[mask], axis=0) if gripper.is_servo else np.zeros(len(axis))
    estimated = estimate_noise(grasps, axis.kinds, finest)
    sensor = np.array([e if g is None else g for g, e in zip(given, estimated, strict=True)], float)
    quantum = np.zeros(len(axis))
    for part in axis.kinds.values():
        quantum[part] = find_step(signals[..., part][mask])
    quantum = np.where(quantum >= _QUANTUM * sensor, quantum, 0.0)
    sigma = np.sqrt(sensor**2 + quantum**2 / 12)
    phase = np.full(mask.shape, -1)
    for index, grasp in enumerate(grasps):
        phase[index, : len(grasp.time_s)] = find_phases(grasp, sigma, gripper)
    phase[~mask] = -1
    weight = np.ones((len(grasps), 1, 1))
    return Target(grasps, signals, mask, sigma, sensor, quantum, None not in given, phase, gripper, weight)
