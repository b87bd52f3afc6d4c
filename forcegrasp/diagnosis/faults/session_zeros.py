"""Encoders or force sensors that have another zero in each session: the gripper was homed anew, or a sensor tared."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.diagnosis.faults.linear_step import linear_step, one_of_each
from forcegrasp.diagnosis.faults.shifted_rows import left_beyond_noise
from forcegrasp.diagnosis.signatures import Background
from forcegrasp.diagnosis.verdict import LEAST_SHARE
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.predict import predict
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target
from forcegrasp.measure.schema import MeasuredGrasp

# A session of fewer grasps says little of its zero; in more sessions than this there are as many zeros as grasps.
_LEAST_GRASPS, _MOST_SESSIONS = 3, 12
# Grasps are dealt out to the sessions by chance so often: zeros of sessions must explain more than any of these did.
_BY_CHANCE = 99
# Homing moves commands and encoders alike; a slope of that is taken over this share of a motor's range.
_HOMING_STEP = 2e-3
# What is off by less than this share of what is off most is not worth a word.
_HARDLY = 0.05


@dataclass(frozen=True, eq=False)
class SessionZeros:
    """By how much zeros of sessions are off: of homing for the radii and places as given, of others from their mean."""

    of: str  #: "readings" of encoders, "homing" of encoders and commands, or "forces"
    sessions: tuple[str, ...]
    change: np.ndarray  #: ``(sessions, columns)``, m or rad, or N
    left: float  #: the sum of squares beyond the noise that they leave, by the linear step

    @property
    def name(self) -> str:
        """As a diagnosis has it."""
        return "force_zeros" if self.of == "forces" else "position_zeros"

    @property
    def check(self) -> str:
        """What to look at."""
        if self.of == "forces":
            return "whether sensors were set to zero between sessions: record a few samples of open fingers in each"
        return "whether the gripper was homed, or its encoders set to zero, between sessions: close it empty in each"

    def words(self, columns: Sequence[str], unit: str) -> str:
        """What differs, and by how much, by the names of the columns; not what hardly does."""
        scale, unit = (1.0, "N") if self.of == "forces" else (1e3, f"m{unit}")
        least = _HARDLY * np.abs(self.change).max()
        told = [
            f"in {session} {', '.join(f'{c} {scale * x:+.2g} {unit}' for c, x in zip(columns, row, strict=True))}"
            for session, row in zip(self.sessions, self.change.tolist(), strict=True)
            if max(map(abs, row)) > least
        ]
        what = {"readings": "encoders have", "homing": "encoders and commands have", "forces": "force sensors have"}
        as_what = "what radii and places say" if self.of == "homing" else "the mean of all grasps"
        return f"{what[self.of]} another zero in each session: {listed(told)}, compared with {as_what}"

    def taken_out(self, grasp: MeasuredGrasp) -> MeasuredGrasp:
        """The grasp as it would have been recorded with the mean zero, or homed where it should be."""
        change = self.change[self.sessions.index(grasp.session)]
        if self.of == "forces":
            return dataclasses.replace(grasp, force_n=grasp.force_n - change)
        command = grasp.command_m - (change if self.of == "homing" else 0.0)
        return dataclasses.replace(grasp, position_m=grasp.position_m - change, command_m=command)


def session_zeros(target: Target, fit: Fit) -> SessionZeros | None:
    """Zeros that differ from session to session, by a linear step; None unless they are some of what a fit leaves.

    Zeros of objects must not do as well, such as a radius that is wrong has them, nor any of the zeros that grasps have
    which are dealt out to the sessions by chance.

    Args:
      target: the measurements.
      fit: of the base model, or of one with effects that had hidden them.
    """
    names = [grasp.session for grasp in target.grasps]
    sessions = tuple(dict.fromkeys(names))
    if not 1 < len(sessions) <= _MOST_SESSIONS or min(Counter(names).values()) < _LEAST_GRASPS:
        return None
    of_session = np.equal.outer(names, sessions).astype(float)
    objects = [grasp.object for grasp in target.grasps]
    of_object = np.equal.outer(objects, list(dict.fromkeys(objects))).astype(float)
    background = Background(fit, ())
    least, best = (1 - LEAST_SHARE) * max(0.0, left_beyond_noise(fit.residual, background, target)), None
    for of, per_unit in _kinds(target, fit).items():
        always = _each(per_unit, of_object)
        most = min(least, linear_step(target, fit, background, always)[1])

        def step(members: np.ndarray, per_unit=per_unit, always=always) -> tuple[np.ndarray, float]:
            """The sizes of zeros that these grasps share, ``(groups, columns)``, and what they leave."""
            sizes, left = linear_step(target, fit, background, np.concatenate([_each(per_unit, members), always], -1))
            width = per_unit.shape[-1]
            return sizes[: members.shape[1] * width].reshape(-1, width), left

        sizes, left = step(of_session)
        if left < most and not _by_chance(of_session, lambda members: step(members)[1], left):
            if of == "homing":  # no effect stands for what all sessions have in common
                alone, _ = linear_step(target, fit, background, _each(per_unit, of_session))
                sizes = alone.reshape(sizes.shape)
            else:
                sizes = sizes - of_session.mean(axis=0) @ sizes
            least, best = left, SessionZeros(of, sessions, sizes, left)
    return best


def _by_chance(of_session: np.ndarray, left: Callable[[np.ndarray], float], least: float) -> bool:
    """Whether grasps that are dealt out by chance, and not as they are, ever leave as little."""
    rng, together = np.random.default_rng(0), of_session @ of_session.T
    dealt = (rng.permutation(of_session) for _ in range(_BY_CHANCE))
    return any(left(one) <= least for one in dealt if not np.array_equal(one @ one.T, together))


def _each(per_unit: np.ndarray, members: np.ndarray) -> np.ndarray:
    """The same for each group of grasps, ``(G, groups)``, alone: ``(G, S, C, groups · columns)``."""
    grasps, samples, channels, _ = per_unit.shape
    return (members[:, None, None, :, None] * per_unit[:, :, :, None]).reshape(grasps, samples, channels, -1)


def _kinds(target: Target, fit: Fit) -> dict[str, np.ndarray]:
    """What a unit of each kind of zero adds to the signals, ``(G, S, C, columns)``."""
    positions, forces = target.axis.positions, target.axis.forces
    kinds = {"readings": one_of_each(target, positions), "forces": one_of_each(target, forces)}
    if target.gripper.command == "position":
        kinds["homing"] = _homing(target, fit)
    return kinds


def _homing(target: Target, fit: Fit) -> np.ndarray:
    """What encoders and commands add whose zero is another: the finger stands elsewhere than they say."""
    gripper, always = target.gripper, one_of_each(target, target.axis.positions)
    case = fit.problem.case(fit.vector)
    before = predict(Simulators(fit.problem).cheap, [case])[0]
    for index, motor in enumerate(gripper.motors):
        step = _HOMING_STEP * motor.stroke
        off = step * np.eye(len(gripper.motors))[index]
        grasps = tuple(
            dataclasses.replace(g, position_m=g.position_m - off, command_m=g.command_m - off) for g in target.grasps
        )
        problem = Problem(gripper, grasps, case.effects)
        moved = predict(Simulators(problem).cheap, [problem.case(fit.vector)])[0]
        always[..., index] += (moved - before) / step
    return always
