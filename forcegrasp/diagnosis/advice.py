"""Which grasp to record next: the one on the menu on which what can't be told apart differs most."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forcegrasp.diagnosis.result import Candidate, Diagnosis
from forcegrasp.identify.predict import Case, predict
from forcegrasp.measure.schema import MeasuredGrasp
from forcegrasp.physics.sampling import offset_limits_m
from forcegrasp.replay.plans import MENU, OFF_CENTRE, PERIOD_S, SAMPLES, make_command
from forcegrasp.replay.replay import Replay
from forcegrasp.short_repr import ShortRepr


@dataclass(frozen=True, repr=False)
class Advice(ShortRepr):
    """The next grasp, and what to expect of it."""

    grasp: str  #: its name on the menu
    rivals: tuple[str, str]  #: the effects that it tells apart
    differences: dict[str, float]  #: grasp on the menu → rms difference of the rivals' predictions ÷ noise
    object: str  #: the set's object that it was worked out for
    time_s: np.ndarray  #: ``(T,)``
    command_m: np.ndarray  #: ``(T, motors)``
    predicted: np.ndarray  #: of the two rivals, ``(2, T, C)``

    def sentence(self) -> str:
        """The advice in words."""
        one, other = self.rivals
        return (
            f"record next: {self.grasp} (on {self.object}); there {one} and {other} differ by"
            f" {self.differences[self.grasp]:.1f} × noise"
        )


def advise(diagnosis: Diagnosis) -> Advice | None:
    """The next grasp to tell the last step's best effects apart; None if there are no two that explain anything."""
    if diagnosis.target.gripper.is_servo:  # the menu is of grasps
        return None
    rivals = _rivals(diagnosis)
    if rivals is None:
        return None
    target, problem = diagnosis.target, rivals[0].fit.problem
    # the object that gives the largest forces shows most
    forces = target.signals[..., target.axis.forces]
    strengths = [forces[i, target.mask[i]].mean() if forces.size else 0.0 for i in range(len(target.grasps))]
    model_grasp = int(np.argmax(strengths))
    cases = [r.fit.problem.case(r.fit.vector) for r in rivals]
    radius = float(cases[0].base["radius_m"][model_grasp])
    gripper = problem.gripper
    kinds = [kind for kind in (*MENU, OFF_CENTRE) if kind != "close and hold"]
    time = np.arange(SAMPLES) * PERIOD_S
    widest, contact = float(gripper.opening.opening_m[-1]) / 2, float(gripper.contact_position(radius))
    room = 0.5 * min(widest - radius, radius / 3, widest / 8)
    grasps, offsets = [], np.array([room if kind == OFF_CENTRE else 0.0 for kind in kinds])
    offsets = np.clip(offsets, *offset_limits_m(gripper, radius, 0.0))
    for kind, offset in zip(kinds, offsets, strict=True):
        command = make_command(kind, contact, gripper.stroke, gripper.stroke / 15, motors=len(gripper.motors))
        rest, unloaded = np.full(command.shape, gripper.stroke), np.zeros((SAMPLES, len(gripper.forces)))
        name = target.grasps[model_grasp].object
        grasps.append(MeasuredGrasp(kind, name, "", radius, offset, None, time, command, rest, unloaded, None))
    moved = []
    for case in cases:
        base = {key: np.full(len(kinds), value[model_grasp]) for key, value in case.base.items()}
        moved.append(Case(base | {"offset_m": offsets}, case.effects))
    predicted = predict(Replay(gripper, grasps, encoders_known=False), moved)
    apart = np.sqrt(np.mean(((predicted[0] - predicted[1]) / target.sigma) ** 2, axis=(1, 2)))
    best = int(np.argmax(apart))
    return Advice(
        kinds[best],
        (rivals[0].effect.name, rivals[1].effect.name),
        dict(zip(kinds, map(float, apart), strict=True)),
        target.grasps[model_grasp].object,
        time,
        grasps[best].command_m,
        predicted[:, best],
    )


def _rivals(diagnosis: Diagnosis) -> tuple[Candidate, Candidate] | None:
    for step in reversed(diagnosis.steps):
        if len(step.candidates) > 1 and (step.effects or len(diagnosis.steps) == 1):
            return step.candidates[0], step.candidates[1]
    return None
