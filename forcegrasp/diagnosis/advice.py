"""Which grasp to record next: the one on the menu that is expected to tell most of what can't be told apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forcegrasp.diagnosis.expected_gain import expected_bits
from forcegrasp.diagnosis.result import Candidate, Diagnosis, kept_steps
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.predict import Case, predict
from forcegrasp.measure.schema import MeasuredGrasp
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.sampling import offset_limits_m
from forcegrasp.replay.next_grasp import NextGrasp
from forcegrasp.replay.plans import MENU, OFF_CENTRE, PERIOD_S, SAMPLES
from forcegrasp.replay.replay import Replay
from forcegrasp.short_repr import ShortRepr

# Step of the slopes, as in a fit: above contact noise, within the linear range.
_STEP = 0.02
# A grasp that is expected to tell less than this of one bit is not worth recording.
_LEAST_BITS = 0.25


@dataclass(frozen=True, repr=False)
class Advice(ShortRepr):
    """The next grasp, and what to expect of it."""

    next_grasp: NextGrasp  #: with the set's object that it was worked out for
    menu: tuple[NextGrasp, ...]  #: all that it was chosen from
    rivals: tuple[str, str]  #: the effects that it tells apart
    differences: dict[str, float]  #: grasp on the menu → rms difference of the rivals' predictions ÷ noise
    bits: dict[str, float]  #: grasp on the menu → what it is expected to tell about which of the two is right, 0 to 1
    time_s: np.ndarray  #: ``(T,)``
    command_m: np.ndarray  #: ``(T, motors)``
    predicted: np.ndarray  #: of the two rivals, ``(2, T, C)``

    @property
    def grasp(self) -> str:
        """Its name on the menu."""
        return self.next_grasp.grasp

    def sentence(self) -> str:
        """The advice in words."""
        one, other = self.rivals
        return (
            f"record next: {self.grasp} (on {self.next_grasp.object}); there {one} and {other} differ by"
            f" {self.differences[self.grasp]:.1f} × noise, which is expected to tell {self.bits[self.grasp]:.2f} bit"
            " of which is right (1 is certainty)"
        )


def advise(diagnosis: Diagnosis) -> Advice | None:
    """The next grasp to tell the effects of :func:`rivals_of` apart.

    None where there are no rivals or no grasp on the menu tells much of which is right, and of servos.
    """
    if diagnosis.target.gripper.is_servo:  # the menu is of grasps
        return None
    rivals = rivals_of(diagnosis)
    if rivals is None:
        return None
    target, gripper = diagnosis.target, diagnosis.target.gripper
    # the object that gives the largest forces shows most
    forces = target.signals[..., target.axis.forces]
    strengths = [forces[i, target.mask[i]].mean() if forces.size else 0.0 for i in range(len(target.grasps))]
    model_grasp = int(np.argmax(strengths))
    fit = rivals[0].fit
    menu = _menu(gripper, target.grasps[model_grasp].object, fit.problem.case(fit.vector), model_grasp)
    time, grasps = np.arange(SAMPLES) * PERIOD_S, []
    for one in menu:
        command, unloaded = one.command(gripper), np.zeros((SAMPLES, len(gripper.forces)))
        rest = np.full(command.shape, gripper.stroke)
        place = (one.radius_m, one.offset_m, None)
        grasps.append(MeasuredGrasp(one.grasp, one.object, "", *place, time, command, rest, unloaded, None))
    replay = Replay(gripper, grasps, encoders_known=False)
    predicted, spreads = zip(*(_predict(r.fit, replay, model_grasp) for r in rivals), strict=True)
    off = (predicted[0] - predicted[1]) / target.sigma
    apart = np.sqrt(np.mean(off**2, axis=(1, 2)))
    flat = [(s / target.sigma[:, None]).reshape(len(menu), -1, s.shape[-1]) for s in spreads]
    bits = [expected_bits(*parts) for parts in zip(off.reshape(len(menu), -1), *flat, strict=True)]
    # most have all of the bit where much is known: then the one that shows it best
    best = max(range(len(menu)), key=lambda k: (round(bits[k], 2), apart[k]))
    if bits[best] < _LEAST_BITS:
        return None
    return Advice(
        menu[best],
        tuple(menu),
        (rivals[0].effect.name, rivals[1].effect.name),
        {one.grasp: float(apart[k]) for k, one in enumerate(menu)},
        {one.grasp: bits[k] for k, one in enumerate(menu)},
        time,
        grasps[best].command_m,
        np.stack(predicted)[:, best],
    )


def _menu(gripper: Gripper, name: str, case: Case, like: int) -> list[NextGrasp]:
    """Every grasp on the menu but the plainest, of the object of one of a case's grasps."""
    radius = float(case.base["radius_m"][like])
    widest, contact = float(gripper.opening.opening_m[-1]) / 2, float(gripper.contact_position(radius))
    room = np.clip(0.5 * min(widest - radius, radius / 3, widest / 8), *offset_limits_m(gripper, radius, 0.0))
    return [
        NextGrasp(
            grasp=kind,
            object=name,
            gripper=gripper.name_or_path,
            radius_m=radius,
            offset_m=float(room) if kind == OFF_CENTRE else 0.0,
            contact=contact,
            squeeze=gripper.stroke / 15,
        )
        for kind in (*MENU, OFF_CENTRE)
        if kind != "close and hold"
    ]


def _predict(fit: Fit, replay: Replay, like: int) -> tuple[np.ndarray, np.ndarray]:
    """What a fit predicts of other grasps of the object of one of its own, and how well it knows that.

    Args:
      fit: of a rival.
      replay: of the grasps to predict.
      like: the fit's grasp whose object it is.

    Returns:
      The signals, ``(K, T, C)``, and their change by one standard deviation of the parameters that concern the object,
      in directions that are independent of each other, ``(K, T, C, p)``.
    """
    problem, count = fit.problem, len(replay.grasps)
    free = [i for i, e in enumerate(problem.entries) if e.members[like] and e.parameter != "offset_m"]
    steps = np.zeros((len(free), len(problem)))
    steps[range(len(free)), free] = np.where(fit.vector[free] + _STEP > problem.high[free], -_STEP, _STEP)
    offsets, cases = np.array([grasp.offset_m for grasp in replay.grasps]), []
    for vector in (fit.vector, *(fit.vector + steps)):
        case = problem.case(vector)
        base = {name: np.full(count, values[like]) for name, values in case.base.items()}
        cases.append(Case(base | {"offset_m": offsets}, case.effects))
    value, *changed = predict(replay, cases)
    slopes = np.stack([(c - value) / step[i] for c, step, i in zip(changed, steps, free, strict=True)], axis=-1)
    # no parameter is less certain than its bounds are apart
    known = fit.slopes.T @ fit.slopes + np.diag(4.0 / (problem.high - problem.low) ** 2)
    root = np.linalg.cholesky(np.linalg.inv(known)[np.ix_(free, free)])
    return value, slopes @ root


def rivals_of(diagnosis: Diagnosis) -> tuple[Candidate, Candidate] | None:
    """Two effects of the last tie; without one, of the last step that found something the best two."""
    steps = kept_steps(diagnosis.steps) or (diagnosis.steps if len(diagnosis.steps) == 1 else ())
    tied_last = sorted(steps, key=lambda step: len(step.effects) > 1)
    found = {step.effects[0] for step in steps if step.effects}
    for step in reversed(tied_last):
        # what another step has found is there besides, and not instead
        likely = [c for c in step.candidates if c.is_plausible and c.effect.name not in found - {*step.effects}]
        tied_first = sorted(likely, key=lambda c: c.effect.name not in step.effects)
        if len(tied_first) > 1:
            return tied_first[0], tied_first[1]
    return None
