"""What a set gives has a tolerance: objects, clock and times of reading are moved within it, as the readings ask."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from forcegrasp.diagnosis.faults.seen_places import seen_places
from forcegrasp.identify.fit import Fit, fit_once
from forcegrasp.identify.givens import OF_OBJECTS, OF_READING, PERIOD, Given, given_slopes, givens_of
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.predict import predict
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.simulators import Simulators, cheap_tier
from forcegrasp.identify.target import Target
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet
from forcegrasp.physics.gripper import FORCE_SKEW, SKEW
from forcegrasp.replay.replay import Replay

#: What is further off than so many standard deviations is no tolerance, if it is one number alone.
MOST = 3.0
#: Standard deviation of radii that a ruler measured, metres.
RULER_M = 3e-4
# What is nearer than so many is not told.
_TOLD = 1.0
# Radii whose mean is so many of its standard deviations below 0 may all be too large, or pads may stand further out.
_ALIKE = 1.5
# All moves together are no surprise if one of so many standard deviations would be as likely.
_NO_SURPRISE = 2.0
#: It is worth a fit if it takes this share off the squares that a fit leaves beyond the noise.
WORTH = 0.5
# Fewer numbers do that take this share of what all would.
_NEARLY = 0.8
# Readings bend with what is given: so many linear steps, or until they are this small.
_STEPS, _SETTLED = 4, 0.1
# What is moved together, the fewest numbers first.
_TIMING = (*OF_READING, PERIOD)
_GROUPS = (*((kind,) for kind in _TIMING), _TIMING, OF_OBJECTS, (*OF_OBJECTS, *_TIMING))
_CHECKS = {
    "object": "the objects: their radii, with a calliper, and where they stood",
    "timing": "the clock, and when readings are taken",
}


@dataclass(frozen=True, eq=False)
class Moved:
    """By how much what is given was moved."""

    numbers: tuple[Given, ...]
    deviations: np.ndarray  #: moves ÷ standard deviation, ``(numbers,)``

    @property
    def moves(self) -> dict[str, float]:
        """By name, such as ``radius_m of sponge``, in metres and seconds; of the period a share."""
        named = zip(self.numbers, self.deviations.tolist(), strict=True)
        return {f"{n.kind} of {n.owner}" if n.owner else n.kind: n.std * move for n, move in named}

    @property
    def groups(self) -> tuple[str, ...]:
        """What was moved: "object", "timing" or both."""
        return tuple(dict.fromkeys(n.group for n in self.numbers))

    @property
    def check(self) -> str:
        """What to look at."""
        return listed([_CHECKS[group] for group in self.groups])

    @property
    def price(self) -> float:
        """Log-likelihood that it costs: the prior's, and 1 for each number that was fitted (Akaike 1974)."""
        return float(len(self.numbers) + np.sum(self.deviations**2) / 2)

    @property
    def is_within(self) -> bool:
        """Whether all are within the tolerance."""
        return bool((np.abs(self.deviations) < _limits(self.numbers)).all())

    @property
    def how(self) -> str:
        """How far, in words."""
        return "within its tolerance" if self.is_within else "by more than its tolerance"

    def radii_apart(self) -> list[str]:
        """Objects whose radius is beyond the tolerance, if that is not so of all alike, as an effect would have it.

        Where there are any, those that are moved at all stand with them: each explains little without the others.
        """
        sizes = {n.owner: move for n, move in zip(self.numbers, self.deviations, strict=True) if n.kind == "radius_m"}
        alike = not sizes or max(sizes.values()) - min(sizes.values()) < MOST
        beyond = not alike and max(map(abs, sizes.values())) >= MOST
        return [name for name, move in sizes.items() if abs(move) >= _TOLD] if beyond else []

    @property
    def _of_radii_m(self) -> list[float]:
        return [by_m for name, by_m in self.moves.items() if name.startswith("radius_m")]

    @property
    def radii_differ_by_m(self) -> float:
        """By how much more one radius was moved than another, metres."""
        return float(np.ptp(self._of_radii_m or [0.0]))

    @property
    def most_of_radii_m(self) -> float:
        """By how much the radius that was moved most was moved, metres."""
        return max(map(abs, self._of_radii_m), default=0.0)

    @property
    def smaller_m(self) -> float:
        """By how much radii were moved down on average, metres, where chance would hardly do it to all; else 0.

        Of three or more the one that was moved furthest down does not count: it alone may be wrong.
        """
        radii = [(n.std, move) for n, move in zip(self.numbers, self.deviations, strict=True) if n.kind == "radius_m"]
        stds, moves = np.array(radii).reshape(-1, 2).T
        if len(radii) < 2:
            return 0.0
        others = np.sort(moves)[1:] if len(radii) > 2 else moves
        alike = max(moves.mean(), others.mean()) < -_ALIKE / np.sqrt(len(radii))
        return float(-np.mean(stds * moves)) if alike else 0.0

    def with_radii_raised(self, by_m: float) -> Moved:
        """The same moves, but of all radii by so much more, metres."""
        more = [by_m / number.std if number.kind == "radius_m" else 0.0 for number in self.numbers]
        return Moved(self.numbers, self.deviations + more)

    @property
    def is_no_surprise(self) -> bool:
        """Whether what is given need be no less exact than was said."""
        return bool(np.sum(self.deviations**2) <= _NO_SURPRISE**2)

    def put(self, grasp: MeasuredGrasp) -> MeasuredGrasp:
        """A grasp with what is given moved."""
        moves = self.moves
        radius, offset, start = grasp.radius_m, grasp.offset_m, grasp.time_s[0]
        slower, late = 1 + moves.get(PERIOD, 0.0), moves.get(SKEW, 0.0)
        return dataclasses.replace(
            grasp,
            radius_m=None if radius is None else radius + moves.get(f"radius_m of {grasp.object}", 0.0),
            offset_m=None if offset is None else offset + moves.get(f"offset_m of {grasp.name}", 0.0),
            time_s=start + slower * (grasp.time_s - start),
            late_s=(late, late + moves.get(FORCE_SKEW, 0.0)),
        )

    def words(self) -> str:
        """What moved by more than its standard deviation, or else by most of it."""
        sizes = np.abs(self.deviations)
        far = [(self.numbers[i], self.numbers[i].std * float(self.deviations[i]))
               for i in np.flatnonzero(sizes >= min(_TOLD, sizes.max()))]  # fmt: skip
        told = [number.words(move) for number, move in far if number.kind != "offset_m"]
        places = {number.owner: abs(move) for number, move in far if number.kind == "offset_m"}
        if places:
            grasps = "grasp" if len(places) == 1 else "grasps"
            told.append(f"place in {grasps} {listed(list(places))} by up to {1e3 * max(places.values()):.2g} mm")
        return listed(told)


def _limits(numbers: Sequence[Given]) -> np.ndarray:
    """By how many standard deviations each may be off, ``(numbers,)``.

    Each grasp has a place of its own: any of two dozen is as likely beyond 3.9 of them as one radius beyond 3.
    """
    places = np.array([number.kind == "offset_m" for number in numbers])
    return np.where(places, norm.isf(norm.sf(MOST) / max(1, places.sum())), MOST)


def all_radii(measured: MeasurementSet, target: Target, move_m: float) -> Moved | None:
    """All radii moved by so much, metres; None if that is more than the tolerance of what is given leaves open."""
    numbers = tuple(number for number in givens_of(measured, target) if number.kind == "radius_m")
    if not numbers or abs(move_m) > _NO_SURPRISE * measured.radius_std_m:
        return None
    return Moved(numbers, np.full(len(numbers), move_m / measured.radius_std_m))


def time_of_reading(measured: MeasurementSet, target: Target, delay_s: float) -> Moved | None:
    """The time of reading moved by so much, s; None if that is more than the tolerance of what is given leaves open."""
    numbers = tuple(number for number in givens_of(measured, target) if number.kind == SKEW)
    if not numbers[0].std or abs(delay_s) > _NO_SURPRISE * numbers[0].std:
        return None
    return Moved(numbers, np.array([delay_s / numbers[0].std]))


def move_given(
    measured: MeasurementSet, target: Target, fit: Fit, worth: float = WORTH, start: Moved | None = None
) -> Moved | None:
    """What :func:`wanted_moves` says, if that is within the tolerance of what is given; else None."""
    moved = wanted_moves(measured, target, fit, worth, start)
    return moved if moved is not None and moved.is_within else None


def wanted_moves(
    measured: MeasurementSet, target: Target, fit: Fit, worth: float = WORTH, start: Moved | None = None
) -> Moved | None:
    """What is given as the readings have it, up to :data:`MOST` standard deviations; None if that explains little.

    Linear steps from a fit, whose parameters follow, with a Gaussian prior of the set's standard deviations on what is
    given: on the time of reading or the clock's period alone, on both, on radii and places, or on all.

    Args:
      measured: the set.
      target: its grasps, lined up.
      fit: of the base model, with all as given.
      worth: least share of the squares beyond the noise.
      start: moves from which the fit started already; none by default, and then they are to explain enough.
    """
    if start is not None:
        first = given_slopes(target, fit, start.numbers), _Step(start, fit.vector, fit.cost)
    elif (first := _first_step(measured, target, fit, worth)) is None:
        return None
    columns, step = first
    numbers = step.moved.numbers
    placed = np.array([number.kind == "offset_m" for number in numbers])
    by_trial = bool(placed.any()) and step.moved.is_within  # places would make up for radii that are further off
    if by_trial and start is None:
        step = step.with_deviations(placed, np.zeros(placed.sum()))  # slopes may point to another jolt
    free = ~placed if by_trial else np.ones(len(numbers), bool)
    for _ in range(_STEPS):
        before = step.moved.deviations
        led, of_moved = _led_to(step, fit, measured, target)
        if by_trial:
            seen = seen_places(of_moved, led, _members(numbers, placed), before[placed], measured.offset_std_m)
            step = step.with_deviations(placed, seen)
            led, of_moved = _led_to(step, fit, measured, target)
        if led.cost > fit.cost:  # slopes say too little so far from where they were found
            led = fit_once(of_moved, led.problem, Simulators(led.problem), fit.vector, fit.correction, rounds=1)
            columns = given_slopes(of_moved, led, numbers)
        moving = [numbers[index] for index in np.flatnonzero(free)]
        fit, after = led, _step(led, columns[:, free], moving, None, step.moved.deviations[free])
        step = dataclasses.replace(after, moved=step.with_deviations(free, after.moved.deviations).moved)
        if np.abs(step.moved.deviations - before).max() < _SETTLED:
            break
    return step.moved if np.any(step.moved.deviations) else None


def _led_to(step: _Step, fit: Fit, measured: MeasurementSet, target: Target) -> tuple[Fit, Target]:
    """The fit as if it had ended where a step leads, on the set as moved; and that set's target."""
    grasps = tuple(step.moved.put(grasp) for grasp in measured.grasps)
    problem = Problem(fit.problem.gripper, grasps, fit.problem.effects)
    vector = np.clip(step.vector, problem.low + 1e-9, problem.high - 1e-9)
    replay = Replay(problem.gripper, problem.grasps, cheap_tier(problem.gripper))
    predicted = predict(replay, [problem.case(vector)])[0] + fit.correction
    residual = target.residual(predicted)
    led = dataclasses.replace(fit, problem=problem, vector=vector, predicted=predicted, residual=residual)
    return led, dataclasses.replace(target, grasps=grasps)


def _members(numbers: Sequence[Given], where: np.ndarray) -> np.ndarray:
    """The grasp that each of these numbers is of, ``(k,)``."""
    chosen = (number for number, is_chosen in zip(numbers, where, strict=True) if is_chosen)
    return np.array([np.flatnonzero(number.members)[0] for number in chosen])


def first_move(measured: MeasurementSet, target: Target, fit: Fit, worth: float = WORTH) -> tuple[Moved, float] | None:
    """The first step of :func:`wanted_moves`, if that explains enough, and the rms error ÷ noise that it leaves."""
    first = _first_step(measured, target, fit, worth)
    return None if first is None else (first[1].moved, float(np.sqrt(first[1].left / target.readings)))


@dataclass(frozen=True, eq=False)
class _Step:
    """A linear step of what is given, and of the parameters that follow."""

    moved: Moved
    vector: np.ndarray  #: the parameters' coordinates after it, ``(p,)``
    left: float  #: sum of squares that it leaves

    def with_deviations(self, where: np.ndarray, deviations: np.ndarray) -> _Step:
        """The step with some numbers moved by so much in all, in standard deviations."""
        every = self.moved.deviations.copy()
        every[where] = deviations
        return dataclasses.replace(self, moved=Moved(self.moved.numbers, every))


def _first_step(measured: MeasurementSet, target: Target, fit: Fit, worth: float) -> tuple[np.ndarray, _Step] | None:
    """One step of the fewest numbers that do nearly as much as all, and their columns; None if all do too little."""
    numbers = givens_of(measured, target)
    columns = given_slopes(target, fit, numbers)
    groups = [kinds for kinds in _GROUPS if any(number.kind in kinds for number in numbers)]
    steps = [_step(fit, columns, numbers, kinds) for kinds in groups]
    explained = [fit.cost - step.left - 2 * step.moved.price for step in steps]
    if max(explained) <= max(worth * (fit.cost - target.readings), 0.0):  # noise may leave less than it should
        return None
    step = next(step for step, share in zip(steps, explained, strict=True) if share > _NEARLY * max(explained))
    return columns[:, [numbers.index(number) for number in step.moved.numbers]], step


def _step(
    fit: Fit,
    columns: np.ndarray,
    numbers: Sequence[Given],
    kinds: Sequence[str] | None = None,
    before: np.ndarray | None = None,
) -> _Step:
    """One linear step of what is given.

    Args:
      fit: of the base model.
      columns: from :func:`_columns`.
      numbers: whose they are.
      kinds: those of the numbers that move; all by default.
      before: moves until now, in standard deviations, ``(numbers,)``.
    """
    chosen = [index for index, number in enumerate(numbers) if kinds is None or number.kind in kinds]
    start = np.zeros(len(chosen)) if before is None else before[chosen]
    slopes = np.column_stack([fit.jacobian.reshape(-1, len(fit.problem)), columns[:, chosen]])
    prior, residual = np.eye(slopes.shape[1])[len(fit.problem) :], fit.residual.ravel()
    step = np.linalg.lstsq(np.vstack([slopes, prior]), np.r_[residual, -start], rcond=None)[0]
    chosen_ones = tuple(numbers[index] for index in chosen)
    limits = _limits(chosen_ones)
    moved = Moved(chosen_ones, np.clip(start + step[len(fit.problem) :], -limits, limits))  # one step may lead too far
    left = float(np.sum((residual - slopes @ step) ** 2))
    return _Step(moved, fit.vector + step[: len(fit.problem)], left)
