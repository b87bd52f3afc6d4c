"""When several effects are added at once, and whether what that finds is kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.diagnosis.evidence import LEAST_SHARE_TOGETHER
from forcegrasp.diagnosis.result import Step
from forcegrasp.diagnosis.search.conclusion import Begun
from forcegrasp.diagnosis.search.left_over import leaves_little, left_over
from forcegrasp.diagnosis.search.screen import Screen
from forcegrasp.diagnosis.search.several import (
    add_several,
    add_up,
    none_stands_out,
    share_of_alike,
    share_of_all,
    share_of_one,
)
from forcegrasp.diagnosis.search.so_far import SoFar
from forcegrasp.diagnosis.search.stop_when import Asked
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import EXPLAINED, EXPLAINED_FAR, explained_share
from forcegrasp.effects import Effect
from forcegrasp.identify.fit import Fit

# Beyond so many times the floor, beside an effect that was found, several others are added at once if none of them
# stands out; or whether one does or not.
_MUCH_LEFT, _VERY_MUCH_LEFT = 3.0, 5.0
# One effect does as well as several if it gains this share of what they do: a fit to few grasps ends within as much.
_AS_WELL = 0.95


@dataclass(eq=False)
class AtOnce:
    """Adds several effects at once, each way once to a fit."""

    so_far: SoFar
    begun: Begun
    rng: np.random.Generator
    given_first: Asked  #: see :class:`.StopWhen`
    done: bool = False  #: whether it was: no other effect promises anything beside what it found
    #: of which one alone does as well as all that add up, though their signatures promise less; they are to be tried
    alone: Sequence[type[Effect]] = ()
    _asked: Fit | None = None  #: the fit that it was last tried for
    _added_up: Fit | None = None  #: the same of effects that add up

    def given_is_first(self, study: Study, fit: Fit) -> bool:
        """Whether what the set gives is to be moved before anything is looked for beside the effects that were found.

        Sizes of objects that are off by a little each, either way, look like effects that make up for one another.
        """
        found_some = len(fit.problem.effects) > self.begun.given
        return found_some and self.given_first(study.target, fit)

    def are_likely(self, study: Study, fit: Fit, screen: Screen, untried: Sequence[type[Effect]]) -> bool:
        """Whether what is left, beside an effect that was found, is not that of one other."""
        if len(fit.problem.effects) == self.begun.given:
            return False
        left = self.begun.left(study, fit)
        return left > _VERY_MUCH_LEFT or (left > _MUCH_LEFT and none_stands_out(study, fit, screen, untried))

    def that_add_up(
        self, study: Study, steps: list[Step], fit: Fit, screen: Screen, untried: Sequence[type[Effect]]
    ) -> bool:
        """Whether several were found by their signatures that together explain nearly all that a fit leaves."""
        if self._added_up is fit or not untried or study.target.gripper.is_servo:
            return False
        self._added_up = fit
        if not add_up(study, fit, screen, untried) or (one := share_of_one(study, fit, screen, untried)) > _AS_WELL:
            return False
        alike = share_of_alike(study, fit, screen, untried)

        def as_well(of_all: float) -> list[type[Effect]]:
            return [effect for effect, share in alike.items() if share > _AS_WELL * of_all]

        self.alone = as_well(1.0)
        if self.alone:
            return False
        begun, before = self.begun, study.error(study.heldout(fit))
        # where no effect alone explains half, these need explain no more than those that are found one by one; and what
        # they leave is looked for so, for a dozen effects more may each explain a little of it
        as_one_by_one = one < EXPLAINED
        least = LEAST_SHARE_TOGETHER if as_one_by_one else EXPLAINED_FAR

        def enough(further: Fit) -> bool:
            after = study.error(study.heldout(further))
            return explained_share(before, after, noise=begun.floor) >= least

        def keep(found: list[Step], further: Fit) -> bool:
            if enough(further):
                self.so_far.all = study, found, further
            little = leaves_little(study, further, begun.error, begun.floor)
            return little or (enough(further) and (as_one_by_one or self.given_is_first(study, further)))

        found = add_several(study, fit, steps, begun.effects, begun.given, self.rng, keep, straight=screen)
        of_all = 0.0 if found is None else share_of_all(study, fit, found[1])
        self.alone = as_well(of_all) if found is not None and enough(found[1]) else ()
        if found is None or not enough(found[1]) or one > _AS_WELL * of_all or self.alone:
            self.so_far.all = study, steps, fit
            return False
        self.so_far.all = study, *found
        self.done |= leaves_little(study, found[1], begun.error, begun.floor)
        return True

    def found(self, study: Study, steps: list[Step], fit: Fit, least_share: float) -> bool:
        """Whether several were found that together explain this share of what a fit leaves, or leave nothing."""
        if self.done or self._asked is fit or study.target.gripper.is_servo:
            return False
        held, self._asked = study.heldout(fit), fit

        def keep(found: list[Step], further: Fit) -> bool:
            enough = study.explained(held, study.heldout(further)) >= least_share
            self.so_far.all = (study, found, further) if enough else (study, steps, fit)
            return False

        further = add_several(study, fit, steps, self.begun.effects, self.begun.given, self.rng, keep)
        if further is None:
            self.so_far.all = study, steps, fit
        elif not left_over(study, further[1])[0]:
            self.so_far.all = study, *further
        else:
            keep(*further)
        self.done = self.so_far.all[2] is not fit
        return self.done
