"""What one recording of a servo has otherwise than the set says, or the clock of all of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.diagnosis.faults.linear_step import linear_step
from forcegrasp.diagnosis.faults.odd_grasps import coordinates_by_name
from forcegrasp.diagnosis.faults.tolerance import MOST
from forcegrasp.diagnosis.signatures import Background
from forcegrasp.diagnosis.verdict import LEAST_SHARE, explained_share
from forcegrasp.identify.base_fit import End, Subset
from forcegrasp.identify.cross_validation import rms
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.predict import predict
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.target import Target
from forcegrasp.measure.check_givens import times
from forcegrasp.measure.schema import PERIOD_STD_SHARE, MeasuredGrasp
from forcegrasp.replay.replay import Replay

#: What may be otherwise besides settings: efforts by a factor, positions and commands by where they are zero; and time
#: stamps of all recordings by a factor. No setting has a name of several words.
EFFORT, CLOCK, ZERO = "scale of efforts", "rate of the clock", "place of zero"
# With fewer recordings nobody tells which one is odd.
_LEAST_RECORDINGS = 3
# Changes are shares of what was said, of the motor's range for where zero is. A slope is taken over the first; the
# number of a recording is fitted in so many steps, of at most the second each, until they are shorter than the third.
_STEP, _LONGEST, _SHORTEST, _STEPS = 0.01, 0.5, 1e-4, 12
# Efforts differ by a sign or a unit alone if they do by this share.
_NEAR, _UNITS = 0.1, (-1.0, 1e3, 1e-3, -1e3, -1e-3)
# A clock is off by what samples are further apart than a period if a linear step says so to this share, or to half.
_NEAR_CLOCK = 0.02
# No clock is doubted for less.
_EXACT_CLOCK = MOST * PERIOD_STD_SHARE
# Changes that are tried, the likeliest first; the recording was the odd one if it is missed by less than so many times
# what the others are then.
_TRIED, _LIKE_OTHERS = 3, 3.0


@dataclass(frozen=True)
class RecordingFault:
    """What differs in a recording from what the set says of it."""

    recording: str  #: its name; empty if it is so in all
    what: str  #: a setting, EFFORT, CLOCK or ZERO
    value: float  #: a factor; of ZERO m or rad; NaN of a setting, which is to be fitted

    @property
    def name(self) -> str:
        """As a diagnosis has it."""
        return "odd_recording" if self.recording else "time_scale"

    def words(self, unit: str) -> str:
        """What seems to be wrong; ``unit`` is that of positions."""
        if self.what == EFFORT:
            return f"efforts of {self.recording} are {self.value:.3g} times what the other recordings make of them"
        if self.what == CLOCK:
            return f"time stamps are {times(self.value)} for how it moves"
        if self.what == ZERO:
            return f"positions and commands of {self.recording} are off by {self.value:+.3g} {unit}"
        return f"{self.what} of {self.recording} is not what the set says"

    @property
    def check(self) -> str:
        """What to look at."""
        if self.what == EFFORT:
            return f"sign and unit of what {self.recording} says of efforts"
        if self.what == CLOCK:
            return "the clock and unit of t_s"
        if self.what == ZERO:
            return f"where the encoder was set to zero before {self.recording}"
        return f"what {self.what} was in {self.recording}, and recordings.csv"

    def fitted(self, recordings: Sequence[MeasuredGrasp]) -> dict[str, float]:
        """The entry of a problem that takes the place of what the set says, and that."""
        if self.what in (EFFORT, CLOCK, ZERO):
            return {}
        recording = next(one for one in recordings if one.session == self.recording)
        return {f"{self.what} of {self.recording}": recording.settings[self.what]}

    def put_right(self, recording: MeasuredGrasp) -> MeasuredGrasp:
        """The recording as it should have been written, or without what it says wrongly; any other as it is."""
        if self.recording not in ("", recording.session):
            return recording
        if self.what == EFFORT:
            return dataclasses.replace(recording, force_n=recording.force_n / self.value)
        return _with(recording, self.what, self.value)


def recording_faults(target: Target, fit: Fit) -> list[RecordingFault]:
    """What of all recordings alike, or else of one of them, may explain what a fit leaves; the likeliest of each.

    Args:
      target: recordings of a servo, in windows.
      fit: of all of them.
    """
    found, search = [], _Search(target, fit)
    clock = search.step(CLOCK, np.arange(len(target.grasps)))
    if clock.explains > LEAST_SHARE and abs(clock.change) > _EXACT_CLOCK:
        found.append(RecordingFault("", CLOCK, _meant(1 + clock.change, CLOCK, target)))
    if len(target.recordings) >= _LEAST_RECORDINGS and (odd := _odd_one(target, fit, search)) is not None:
        found.append(odd)
    return found


def _odd_one(target: Target, fit: Fit, search: _Search) -> RecordingFault | None:
    """The recording that a fit of the others misses, unless one number is changed; None if there is none."""
    steps = [
        (search.step(what, m), what, name) for what in _may_differ(target) for name, m in target.recordings.items()
    ]
    likely = sorted((one for one in steps if one[0].explains > LEAST_SHARE), key=lambda one: -one[0].explains)
    known: dict[str, tuple[End, np.ndarray]] = {}
    least, best = _LIKE_OTHERS, None
    for _, what, name in likely[:_TRIED]:
        members = target.recordings[name]
        if name not in known:
            others = Subset(target, np.setdiff1d(np.arange(len(target.grasps)), members), fit)
            end = others.fit(others.known)
            known[name] = end, others.enlarge(end.vector)
        end, vector = known[name]
        part = target.subset(members)
        change, error = _best_change(part, (fit.problem, vector), what)
        if error / max(1.0, end.error) < least:
            least = error / max(1.0, end.error)
            value = change * part.gripper.motors[0].stroke if what == ZERO else _meant(1 + change, what, part)
            best = RecordingFault(name, what, value if what in (EFFORT, ZERO) else np.nan)
    return best


@dataclass(frozen=True)
class _Step:
    """A linear step of one change of some recordings and of all that was fitted."""

    change: float
    explains: float  #: share of the mean square beyond the noise


class _Search:
    """What a fit leaves, and what changes of recordings would take off it."""

    def __init__(self, target: Target, fit: Fit) -> None:
        self._target, self._fit, self._background = target, fit, Background(fit, ())
        self._as_said = _predicted(target, (fit.problem, fit.vector), EFFORT, 0.0)
        self._slopes: dict[str, np.ndarray] = {}
        self._before = rms(self._left(fit.residual), target)

    def step(self, what: str, members: np.ndarray) -> _Step:
        """What a change of these windows would do."""
        if what not in self._slopes:
            self._slopes[what] = self._slope(what)
        column = np.zeros((*self._slopes[what].shape, 1))
        column[members, ..., 0] = self._slopes[what][members]
        if not column.any():
            return _Step(0.0, 0.0)
        size, _ = linear_step(self._target, self._fit, self._background, column)
        left = self._left(self._fit.residual - self._target.change(column[..., 0] * size, 0.0))
        return _Step(float(size[0]), explained_share(self._before, rms(left, self._target)))

    def _slope(self, what: str) -> np.ndarray:
        """What a change of each recording adds to its signals, ``(G, S, C)``."""
        changed = _predicted(self._target, (self._fit.problem, self._fit.vector), what, _STEP)
        return (changed - self._as_said) / _STEP

    def _left(self, residual: np.ndarray) -> np.ndarray:
        """What of residuals no parameter follows, ``(G, S, C)``."""
        weight = self._fit.weight
        return self._background.remove((weight * residual).ravel()).reshape(residual.shape) / weight


def _may_differ(target: Target) -> list[str]:
    """What may be otherwise in a recording: settings that all of them say, and how it was written."""
    return [EFFORT, ZERO, *sorted(set.intersection(*(set(grasp.settings) for grasp in target.grasps)))]


def _meant(factor: float, what: str, part: Target) -> float:
    """A factor, or what it was meant to be if that is near: a sign or a unit; samples as far apart as a period."""
    if what == EFFORT:
        meant = min(_UNITS, key=lambda unit: abs(unit / factor - 1))
        return meant if abs(meant / factor - 1) < _NEAR else factor
    apart = float(np.median(np.concatenate([np.diff(grasp.time_s) for grasp in part.grasps])))
    meant = apart / part.gripper.period_s
    return meant if abs(meant - factor) < max(_NEAR_CLOCK, abs(meant - 1) / 2) else factor


def _best_change(part: Target, known: tuple[Problem, np.ndarray], what: str) -> tuple[float, float]:
    """The change of one recording that fits it best under parameters of the others, and its rms error ÷ noise then."""
    change, predicted = 0.0, _predicted(part, known, what, 0.0)
    residual = part.residual(predicted)
    for _ in range(_STEPS):
        slope = part.change(_predicted(part, known, what, change + _STEP), predicted) / _STEP
        step = float(np.sum(slope * residual) / max(float(np.sum(slope**2)), 1e-12))
        if what != EFFORT:  # of which the readings are linear
            step = float(np.clip(step, -_LONGEST * (1 + change), _LONGEST * (1 + change)))
        while abs(step) > _SHORTEST:
            there = _predicted(part, known, what, change + step)
            if np.sum(part.residual(there) ** 2) < np.sum(residual**2):
                break
            step /= 2
        else:
            break
        change, predicted, residual = change + step, there, part.residual(there)
    if what == EFFORT:  # noise was scaled as well
        residual[..., part.axis.forces] /= 1 + change
    return change, rms(residual, part)


def _predicted(target: Target, known: tuple[Problem, np.ndarray], what: str, change: float) -> np.ndarray:
    """The signals of all windows, ``(G, S, C)``, were this otherwise in each of their recordings by so much."""
    gripper, grasps = target.gripper, target.grasps
    if what != EFFORT:
        grasps = tuple(_changed(target, grasp, what, change) for grasp in grasps)
    problem = Problem(gripper, grasps, known[0].effects)
    signals = predict(Replay(gripper, grasps), [problem.case(coordinates_by_name(problem, known))])[0]
    if what == EFFORT:
        signals[..., target.axis.forces] *= 1 + change
    if what == ZERO:
        signals[..., target.axis.positions] += change * target.gripper.motors[0].stroke
    return signals


def _changed(target: Target, grasp: MeasuredGrasp, what: str, change: float) -> MeasuredGrasp:
    """A window as it would have been, were what the set says off by so much."""
    if what == ZERO:
        return _with(grasp, what, change * target.gripper.motors[0].stroke)
    return _with(grasp, what, 1 + change if what == CLOCK else (1 + change) * grasp.settings[what])


def _with(grasp: MeasuredGrasp, what: str, value: float) -> MeasuredGrasp:
    """A recording, or a window of one, with another setting, with its time or where it is zero put right by a value."""
    start, before = grasp.start, grasp.before
    if what == CLOCK:
        time = grasp.time_s[0] + (grasp.time_s - grasp.time_s[0]) / value
        start = None if start is None else (start[0], start[1] * value)
        before = None if before is None else (before[0] / value, *before[1:])
        return dataclasses.replace(grasp, time_s=time, start=start, before=before)
    if what != ZERO:
        return dataclasses.replace(grasp, settings={**grasp.settings, what: value})
    off = value * (grasp.columns.command[0].startswith("qdes"))  # commands of forces have no zero
    return dataclasses.replace(
        grasp,
        position_m=grasp.position_m - value,
        command_m=grasp.command_m - off,
        start=None if start is None else (start[0] - value, *start[1:]),
        before=None if before is None else (before[0], before[1] - off, before[2] - value),
    )
