"""What a model is compared with: the measured signals as one array, their noise, and the phases of the grasps."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.identify.rounding import find_step
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet
from forcegrasp.physics.gripper import Gripper
from forcegrasp.short_repr import ShortRepr

PHASES = ("free", "first_contact", "both", "hold", "release")

# Rounding to steps smaller than this many σ is hidden by the noise.
_QUANTUM = 1.0
# A command that has not changed for this long is held; contact is young, or just lost, for this long. Seconds.
_HELD_S, _TRANSITION_S = 0.3, 0.2
# Without a force sensor: a motor that moves by less than this share of its largest command step hardly moves.
_STALL = 0.1


@dataclass(frozen=True, repr=False)
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
    phase: np.ndarray  #: index into :data:`PHASES`, ``(G, S)``; −1 where there is no sample
    gripper: Gripper  #: whose channels they are

    @property
    def names(self) -> list[str]:
        """The channels' names, such as position_l."""
        return [channel.name for channel in self.gripper.positions + self.gripper.forces]

    @property
    def units(self) -> list[str]:
        """The channels' units: m, rad or N."""
        return [channel.unit for channel in self.gripper.positions + self.gripper.forces]

    @property
    def positions(self) -> slice:
        """Which channels are positions of motors."""
        return slice(0, len(self.gripper.motors))

    @property
    def forces(self) -> slice:
        """Which channels are forces; it may be none."""
        return slice(len(self.gripper.motors), self.signals.shape[-1])

    @property
    def kinds(self) -> dict[str, slice]:
        """Channels of one kind, those that there are."""
        both = {"position": self.positions, "force": self.forces}
        return {kind: part for kind, part in both.items() if part.stop > part.start}

    @property
    def sides(self) -> list[list[int]]:
        """Position and force, if any, of each side; a channel that both sides share is in both."""
        parts = list(self.kinds.values())
        count = max(part.stop - part.start for part in parts)
        return [[min(part.start + side, part.stop - 1) for part in parts] for side in range(count)]

    def side_of(self, channel: int) -> list[int]:
        """The side that a channel is of, as in :attr:`sides`."""
        return next(side for side in self.sides if channel in side)

    @property
    def readings(self) -> int:
        """Number of readings of all channels."""
        return int(self.mask.sum()) * self.signals.shape[-1]

    @property
    def rounding(self) -> tuple[float, float]:
        """Step of the positions and of the forces; 0 where there is none."""
        position, force = (self.quantum[part] for part in (self.positions, self.forces))
        return float(position[0]), float(force.max(initial=0.0))

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
        """(measured − predicted) ÷ noise, ``(..., G, S, C)``; 0 where there is no sample."""
        return np.where(self.mask[:, :, None], (self.signals - predicted) / self.sigma, 0.0)


def make_target(measured: MeasurementSet, gripper: Gripper) -> Target:
    """Lines up a measurement set, estimates its noise where it is not given, and finds the phases."""
    grasps, count = measured.grasps, len(gripper.positions + gripper.forces)
    samples, kinds = max(len(g.time_s) for g in grasps), _kinds(grasps)
    signals, mask = np.zeros((len(grasps), samples, count)), np.zeros((len(grasps), samples), bool)
    for index, grasp in enumerate(grasps):
        n = len(grasp.time_s)
        signals[index, :n] = np.concatenate([grasp.position_m, grasp.force_n], axis=1)
        mask[index, :n] = True
    stds = {"positions": measured.position_std_m, "forces": measured.force_std_n}
    given = [stds[kind] for kind, part in kinds.items() for _ in range(part.start, part.stop)]
    estimated = estimate_noise(grasps)
    sensor = np.array([e if g is None else g for g, e in zip(given, estimated, strict=True)], float)
    quantum = np.zeros(count)
    for part in kinds.values():
        quantum[part] = find_step(signals[..., part][mask])
    quantum = np.where(quantum >= _QUANTUM * sensor, quantum, 0.0)
    sigma = np.sqrt(sensor**2 + quantum**2 / 12)
    phase = np.full(mask.shape, -1)
    for index, grasp in enumerate(grasps):
        phase[index, : len(grasp.time_s)] = find_phases(grasp, sigma, gripper)
    return Target(grasps, signals, mask, sigma, sensor, quantum, None not in given, phase, gripper)


def _kinds(grasps: tuple[MeasuredGrasp, ...]) -> dict[str, slice]:
    """Channels of positions and, if there are any, of forces."""
    motors, forces = grasps[0].position_m.shape[1], grasps[0].force_n.shape[1]
    positions = {"positions": slice(0, motors)}
    return positions | ({"forces": slice(motors, motors + forces)} if forces else {})


def estimate_noise(grasps: tuple[MeasuredGrasp, ...]) -> np.ndarray:
    """Sensor noise of each signal from its third differences, where the command is held; ``(C,)``.

    Third differences of a smooth signal vanish and those of white noise have variance 20 σ². Channels of one kind
    share one figure. Without repeated grasps this is a lower bound: noise that is slow looks like motion.

    Raises:
      MeasurementError: if a signal does not vary at all, or nothing is long enough.
    """
    differences: list[np.ndarray] = []
    for grasp in grasps:
        third, held = third_differences(grasp, np.concatenate([grasp.position_m, grasp.force_n], axis=1))
        differences.append(third[held] if held.sum() > 5 else third)
    third = np.concatenate(differences)
    sigma = np.zeros(third.shape[1])
    for kind, part in _kinds(grasps).items():
        values = third[:, part].ravel()
        robust = 1.4826 * np.median(np.abs(values)) if len(values) else 0.0
        estimate = (robust if robust > 0 else np.sqrt(np.mean(values**2)) if len(values) else 0.0) / np.sqrt(20)
        if not estimate > 0:
            raise MeasurementError(
                f"the noise of the {kind} can't be told from the data: give position_std_m and force_std_n in meta.yaml"
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
    return signals, _held_for(grasp)[reach:] >= _HELD_S + time[reach:] - time[:-reach]


def find_phases(grasp: MeasuredGrasp, sigma: np.ndarray, gripper: Gripper) -> np.ndarray:
    """Phase of each sample, as an index into :data:`PHASES`, ``(T,)``, from the measured data alone.

    Args:
      grasp: the grasp.
      sigma: noise of its signals, as for :func:`contacts`.
      gripper: that recorded it.
    """
    touching = contacts(grasp, sigma, gripper)
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
    phase[any_touch & (~both | (since_both < _TRANSITION_S))] = PHASES.index("first_contact")
    phase[~any_touch] = PHASES.index("free")
    recently = _time_since_end(time, any_touch) < _TRANSITION_S
    leaving = opening & ((any_touch & ~(both & held)) | (~any_touch & recently))
    phase[leaving] = PHASES.index("release")
    return phase


def contacts(grasp: MeasuredGrasp, sigma: np.ndarray, gripper: Gripper) -> np.ndarray:
    """Which finger touches, by its force beyond what it reads in free air, ``(T, channels)``.

    Without force readings the way that a motor is behind its command takes their place, ``(T, motors)``.

    Args:
      grasp: the grasp.
      sigma: noise of its signals, ``(C,)``; the forces' is enough where there are any.
      gripper: that recorded it.
    """
    push = grasp.force_n if grasp.force_n.shape[1] else grasp.position_m - grasp.command_m
    start = push[: max(3, min(8, len(push) // 10))]
    beyond, least = push - np.median(start, axis=0), 5 * sigma[-push.shape[1] :]
    if gripper.force == "sensors":
        return beyond > least
    moved = _moved(grasp, gripper.period_s)
    least, still = _effort_of_closing(beyond, moved, gripper, least), np.abs(moved) < _STALL * gripper.max_step
    for index in range(1, len(still)):  # a contact lasts until the push ends
        still[index] |= still[index - 1] & (beyond[index - 1] > least)
    return still & (beyond > least)


def _moved(grasp: MeasuredGrasp, period_s: float) -> np.ndarray:
    """How far each motor moved in the control period before each sample, ``(T, motors)``; opening is positive."""
    before = np.searchsorted(grasp.time_s, grasp.time_s - 1.01 * period_s)
    return grasp.position_m - grasp.position_m[before]


def _effort_of_closing(beyond: np.ndarray, moved: np.ndarray, gripper: Gripper, least: np.ndarray) -> np.ndarray:
    """What of a push friction alone may hold, ``(channels,)``: little of what it takes to close; ``least`` at least."""
    closing = np.where(moved < -_STALL * gripper.max_step, beyond, np.nan)
    columns = [column[np.isfinite(column)] for column in closing.T]
    return np.maximum(least, [np.quantile(column, 0.25) if len(column) else 0.0 for column in columns])


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
