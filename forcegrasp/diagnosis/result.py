"""What a search for missing effects found: its steps, their candidates, and the diagnosis that they add up to."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from forcegrasp.diagnosis.faults.fault import Fault
from forcegrasp.diagnosis.faults.odd_grasps import OddGrasp
from forcegrasp.diagnosis.found_law import FoundLaw
from forcegrasp.diagnosis.leads import Lead
from forcegrasp.diagnosis.noise.clock_jitter import ClockJitter, clock_jitter
from forcegrasp.diagnosis.noise.noise_check import Noise, is_uneven_noise
from forcegrasp.diagnosis.signatures import Score
from forcegrasp.diagnosis.verdict import LITTLE, MUCH, explained_share
from forcegrasp.effects import Effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.base_fit import BaseFit
from forcegrasp.identify.cross_validation import heldout_residual
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.noise_floor import beyond_fit, numerical_floor
from forcegrasp.identify.target import Target
from forcegrasp.identify.verdict import Verdict
from forcegrasp.short_repr import ShortRepr, counted, some

#: Stands for the verdict of a step that found no effect, in JSON and where it is printed.
NOTHING = "none"


@dataclass(frozen=True, eq=False, repr=False)
class Candidate(ShortRepr):
    """One effect, refitted together with everything else."""

    setting: EffectSetting  #: the effect, as it was fitted
    fit: Fit
    p_family: float  #: probability that the best signature of sensor noise does as well
    gains: np.ndarray  #: change of each held-out grasp's log-likelihood, ``(G,)``
    error_after: float  #: held-out rms residual ÷ noise
    share: float  #: share of the mean square beyond the noise that it explains
    largest_fall: float  #: largest share by which the error of a signal in a phase falls
    signature: np.ndarray  #: unit vector, ``(N,)``
    replaces: str = ""  #: the effect that it contains and takes the place of, if one is in the model
    #: the gains of each of a servo's recordings, ``(R,)``, for their windows err alike; None of grasps
    of_recordings: np.ndarray | None = None
    harms: bool = False  #: whether some recording is surely worse with it
    without: Fit | None = None  #: the final model without it, if it was found together with others

    def summary(self) -> str:
        sizes = some(f"{name} {value:.3g}" for name, value in self.parameters().items())
        return f"{self.effect.name}: error {self.error_after:.2f} × noise, gain {self.heldout_gain:+.0f}, {sizes}"

    @property
    def effect(self) -> type[Effect]:
        """The effect's class."""
        return self.setting.effect

    def parameters(self) -> dict[str, float]:
        """The effect's fitted parameters."""
        return self.setting.parameters

    @property
    def evidence(self) -> np.ndarray:
        """Gains that are evidence apart: of grasps, or of recordings."""
        return self.gains if self.of_recordings is None else self.of_recordings

    @property
    def is_plausible(self) -> bool:
        """Whether it is as large as it must be: columns are swapped or not, integrators make lags of their own."""
        effect, size = self.effect, self.setting.values[0]
        least = effect.least_steps * self.fit.problem.gripper.integrators_differ_s if effect.least_steps else -np.inf
        return bool(size >= max(effect.least_size, least))

    @property
    def heldout_gain(self) -> float:
        """Change of the held-out log-likelihood, all grasps together."""
        return float(np.nansum(self.gains))


@dataclass(frozen=True, repr=False)
class Step(ShortRepr):
    """One step of the search: one more effect, or none."""

    effects: tuple[str, ...]  #: the effect found, or those that can't be told apart, best first; none if nothing was
    candidates: tuple[Candidate, ...]  #: refitted, best first
    scores: tuple[Score, ...]  #: best signature of each effect, best first
    error_before: float
    error_after: float
    of_many: bool = False  #: it explains little: one of several, or a look-alike of what is not known
    #: whether all effects together promise so little of what is left that it is in no catalogue
    of_none: bool = False

    @property
    def replaces(self) -> str:
        """The effect of an earlier step that this one's contains, and takes the place of."""
        return self.candidates[0].replaces if self.effects and self.candidates else ""

    @property
    def verdict(self) -> Verdict | None:
        """Whether one effect was found or several that can't be told apart; None if there is none."""
        if not self.effects:
            return None
        return Verdict.EFFECT if len(self.effects) == 1 else Verdict.ONE_OF

    @property
    def is_counted(self) -> bool:
        """Whether the effect was found by counting the values of readings, without any fit."""
        return bool(self.effects) and not self.candidates

    def summary(self) -> str:
        change = f"error {self.error_before:.2f} → {self.error_after:.2f} × noise"
        return (
            f"{self.verdict or NOTHING}: {some(self.effects)}; {change}, {counted(len(self.candidates), 'candidate')}"
        )


def kept_steps(steps: Sequence[Step]) -> list[Step]:
    """The steps that found something that no later step put something else in place of."""
    return [step for step in steps if step.effects and not taken_over_by(step, steps)]


def taken_over_by(step: Step, steps: Sequence[Step]) -> str:
    """The effect that a later one of the steps put in place of what this one found; empty if none did."""
    place = next(index for index, one in enumerate(steps) if one is step)
    return next((later.effects[0] for later in steps[place + 1 :] if later.replaces == step.effects[0]), "")


def falls_by_effect(steps: Sequence[Step]) -> dict[str, float]:
    """By how much the mean square falls with each effect that was found, and with the one whose place it took."""
    falls: dict[str, float] = {}
    for step in steps:
        if step.effects:
            fall = step.error_before**2 - step.error_after**2
            falls[step.effects[0]] = float(fall) + falls.pop(step.replaces, 0.0)
    return falls


def settle_ties(steps: Sequence[Step]) -> list[Step]:
    """The steps less rivals that a later step has found besides: what is there as well is not there instead."""
    found = {step.effects[0] for step in kept_steps(steps)}
    return [
        dataclasses.replace(step, effects=(*step.effects[:1], *(n for n in step.effects[1:] if n not in found)))
        for step in steps
    ]


@dataclass(frozen=True, repr=False)
class Diagnosis(ShortRepr):
    """What the data say that the model lacks."""

    verdict: Verdict
    effects: tuple[str, ...]  #: those in the model, in the order found; with "one_of" then the rivals of each
    steps: tuple[Step, ...]
    base: BaseFit
    fit: Fit  #: with the effects that were found
    target: Target
    folds: tuple[np.ndarray, ...]
    error_before: float
    error_after: float
    numerical: tuple[np.ndarray, ...] = field(default=())  #: of the final fit, each ``(G, S, C)``
    by_givens: tuple[np.ndarray, ...] = field(default=())  #: of the final fit, as what is given is not exact, as above
    floor: float = 1.0  #: error that sensor noise and the base model's own numerical error leave
    left: str = ""  #: where there is more than that, in words; empty if nowhere
    odd: tuple[OddGrasp, ...] = ()  #: grasps that a fit of all others misses by far
    noise: Noise | None = None  #: what the noise is, if the residuals show that it is not as assumed
    law: FoundLaw | None = None  #: that explains what no effect does, if one was looked for and found
    law_sought: bool = False  #: whether one was looked for
    fault: Fault | None = None  #: of the set: put right in all of the above; or else the last of the rivals
    error_moved: float | None = None  #: before any effect, with the set moved or put right; None if it was not
    #: The same with effects that explain too little to be believed, if there are; a move within tolerance may bear
    #: them out.
    bolder: Diagnosis | None = None
    stopped: str = ""  #: why the search was cut short, in words; empty if it was not
    leads: tuple[Lead, ...] = ()  #: what promised most by then, which was not judged yet, best first
    left_out: tuple[OddGrasp, ...] = ()  #: grasps of which the rest does not speak, with what the final model leaves
    alone: str = ""  #: the one grasp that shows more than noise, in words, where all others show none; empty if none
    may_be_forms: bool = False  #: whether what is left is no more than the forms of what was found may be off by

    @property
    def preferred(self) -> tuple[str, ...]:
        """The effects that were found and are in the final model: of those that can't be told apart the first."""
        return tuple(step.effects[0] for step in kept_steps(self.steps))

    @property
    def is_of_none(self) -> bool:
        """Whether what is missing seems to be in no catalogue, however its effects are put together."""
        return any(step.of_none for step in self.steps)

    @property
    def inexact(self) -> tuple[np.ndarray, ...]:
        """What may lead the final fit's parameters besides noise, each ``(G, S, C)``."""
        return (*self.numerical, *self.by_givens)

    @property
    def fault_is_rival(self) -> bool:
        """Whether the set may be wrong instead, and these data can't tell."""
        return self.fault is not None and self.fault.name in self.effects[1:]

    @cached_property
    def floor_of_model(self) -> float:
        """The floor with the numerical error of the final model, whose fingers may slip a step early or late."""
        if not self.numerical:  # nothing was looked for: the base model is the final one
            return self.floor
        return numerical_floor(beyond_fit(self.fit, self.numerical), self.target)

    @property
    def error_of_base(self) -> float:
        """The error before what was found: effects get no credit for a set that was moved or put right."""
        if self.error_moved is None or self.verdict is Verdict.DATA:
            return self.error_before
        return self.error_moved

    @cached_property
    def is_uneven_noise(self) -> bool:
        """Whether what is left looks like noise that is larger in some states than in others."""
        if not self.left or not self.numerical or self.error_after <= self.floor_of_model:
            return False
        numerical = beyond_fit(self.fit, self.numerical)
        return is_uneven_noise(self.heldout(), numerical, self.target, self.fit.predicted)

    @cached_property
    def clock_jitter(self) -> ClockJitter | None:
        """By how much rows are read off their time stamps; None if that is not seen, or the model lacks too much."""
        if not self.numerical or self.error_after > MUCH * self.floor:
            return None
        return clock_jitter(self.heldout(), self.target, self.fit)

    @property
    def explained(self) -> float:
        """Share of the held-out mean square beyond the noise that the effects found explain."""
        noise = self.error_after if self.noise is not None and not self.left else 1.0
        return float(np.clip(explained_share(self.error_of_base, self.error_after, noise), 0.0, 1.0))

    def shares(self) -> dict[str, float]:
        """Share of the held-out mean square beyond the noise that each effect of the final model explains.

        An effect that took the place of one that it contains has that one's share, too. Rounding is part of the noise.
        """
        found = [step for step in self.steps if step.effects and not step.is_counted]
        beyond = max(found[0].error_before ** 2 - 1.0, 1e-9) if found else 1.0
        shares = {name: fall / beyond for name, fall in falls_by_effect(found).items()}
        # recordings are weighed anew after each step, and what one starts from is then not what the last one left
        most, total = 1.0 - max(0.0, self.error_after**2 - 1.0) / beyond, sum(shares.values())
        factor = min(1.0, most / total) if total > 0 else 1.0
        return {name: factor * share for name, share in shares.items()}

    @property
    def doubted(self) -> tuple[str, ...]:
        """Effects that were found, but may stand for another form of the largest of them than the catalogue's.

        They explain little beside it, and not all that it leaves. Of a servo none is: motions that are held out as
        wholes show what of the largest one's form another effect explains.
        """
        shares = self.shares()
        if not self.left or self.target.gripper.is_servo:
            return ()
        return tuple(name for name, share in shares.items() if share < LITTLE * max(shares.values()))

    def summary(self) -> str:
        change = f"error {self.error_before:.2f} → {self.error_after:.2f} × noise, floor {self.floor:.2f}"
        return f"{self.verdict}: {some(self.effects)}; {change}"

    def heldout(self) -> np.ndarray:
        """Residuals of held-out grasps under the final fit, ``(G, S, C)``."""
        return heldout_residual(self.fit, self.target, self.folds)
