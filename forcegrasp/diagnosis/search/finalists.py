"""Which rough fits of a step are fitted to the end, and what else is held against the best of them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import partial

import numpy as np

from forcegrasp.diagnosis import families
from forcegrasp.diagnosis.evidence import LEAST_SHARE_OF_MANY, add_nothing, indistinguishable
from forcegrasp.diagnosis.result import Candidate
from forcegrasp.diagnosis.search.refine import AS_GOOD, LOST_IF_FITTED, NO_BETTER, refine_anyway
from forcegrasp.diagnosis.search.start import Start, least_cost
from forcegrasp.diagnosis.search.to_the_end import ALL_FITTED, to_the_end
from forcegrasp.diagnosis.verdict import EXPLAINED_FAR
from forcegrasp.effects import Effect
from forcegrasp.identify.base_fit import rms_error
from forcegrasp.identify.fit import Fit, fit_exactly
from forcegrasp.identify.noise_floor import excess
from forcegrasp.identify.side_by_side import side_by_side

# Of rough fits that can't be told apart the best ones are fitted to the end.
_REFINED = 3


def _as_good(best: Candidate, others: Sequence[Candidate]) -> list[Candidate]:
    """Those of the other variants of an effect that rough fits can't tell from the best one."""
    return [one for one in others if not one.replaces and NO_BETTER * one.fit.cost < best.fit.cost]


class Finalists:
    """Fits the best candidates of a step to the end, and what may have been ahead of them.

    Args:
      start: of the step.
      effects: all that may be added.
      null: gains of the best signature of noise.
    """

    def __init__(self, start: Start, effects: Sequence[type[Effect]], null: np.ndarray) -> None:
        self._start, self._effects, self._null = start, effects, null
        self._study, self._fit = start.study, start.fit

    def fitted(self, variants: Sequence[Sequence[Candidate]]) -> tuple[tuple[Candidate, ...], set[str]]:
        """Fits the best one, and those indistinguishable from it, on the reference tier: rough fits may stop short.

        Also returns the names of effects that add nothing to one that they contain.

        Args:
          variants: candidates of each effect, best first.
        """
        ordered = [of_effect[0] for of_effect in variants]  # of several variants the best one
        alike = {best.effect.name: _as_good(best, others) for best, *others in variants}
        near = [c for c in ordered if c is ordered[0] or indistinguishable(ordered[0], c)][:_REFINED]
        contained = {nested.effect for c in near for nested in c.effect.contains}
        simpler = [c for c in ordered if c.effect.name in contained and c not in near]
        least = min((c.fit.cost for c in near), default=np.inf)
        near += [c for c in simpler if least_cost(c.fit, self._fit) < least]  # others can't do for what contains them
        # what leaves more than the model without it, roughly, is held against that on few grasps first
        doubted = [c for c in near if c.fit.cost > self._fit.cost and not c.replaces]
        hopeless = {c.effect.name for c in doubted if not self._leads_further(c, self._fit, "the model without it")}
        near = [c for c in near if c.effect.name not in hopeless]
        rough = {c.effect.name: c.fit for c in near}
        simple = [c for c in near if c.effect.name in contained]
        refined = self._at_the_end(simple, alike)
        others = [c for c in near if c not in simple]
        refined += self._at_the_end(
            [c for c in others if not any(self._is_enough(one, rough, c) for one in refined)], alike
        )
        refined = self._compare_with_contained(refined)
        names = {c.effect.name for c in refined}
        every = [*refined, *(c for c in ordered if c.effect.name not in names)]
        names |= hopeless
        families_tried: set[str] = set()
        doubted_of_set: set[str] = set()
        while True:
            redundant = add_nothing(every, enough=ALL_FITTED**2 * self._study.target.readings)
            every = self._start.best_first(every, last=redundant)
            first = every[0] if every else None
            if first is None:
                return (), redundant
            if first.effect.name not in names and not first.replaces:  # the last were fitted to the end already
                rough_ones = [c for c in every if c.effect.name not in names and not c.replaces]
                if names and not any(self._start.shows(c, LEAST_SHARE_OF_MANY) for c in rough_ones):
                    return tuple(every), redundant  # and no rough fit is worth more
                # fitted to the end the others are no better than this rough one: it is to be fitted, too
                names.add(first.effect.name)
                (every[0],) = self._at_the_end([first], alike)
            elif of_set := self._mistakes_instead(first, every, names):
                names.update(c.effect.name for c in of_set)
                fitted = {c.effect.name: c for c in self._at_the_end(of_set, alike)}
                every = [fitted.get(c.effect.name, c) for c in every]
            elif self._may_be_a_look_alike(first) and (rivals := self._rivals(first, every, names)):
                names.update(c.effect.name for c in rivals)
                nearer = self._at_the_end(
                    [c for c in rivals if self._leads_further(c, first.fit, first.effect.name)], alike
                )
                fitted = {c.effect.name: c for c in nearer}
                every = [fitted.get(c.effect.name, c) for c in every]
            elif first.effect.family not in families_tried and self._may_be_a_look_alike(first):
                families_tried.add(first.effect.family)
                fitted = {c.effect for c in every}
                better = self._better_look_alikes(first, [e for e in self._effects if e not in fitted])
                alike |= {c.effect.name: [] for c in better}
                every += better
            elif first.effect.of_set and not first.replaces and first.effect.name not in doubted_of_set:
                doubted_of_set.add(first.effect.name)
                fitted = {c.effect for c in every}
                as_good = self._instead_of_set(first, [e for e in self._effects if e not in fitted])
                alike |= {c.effect.name: [] for c in as_good}
                every += as_good
            else:
                return tuple(every), redundant

    def simpler_first(self, ordered: Sequence[Candidate]) -> tuple[Candidate, set[str]]:
        """The best candidate, or what it contains, if that can't be told from a mistake of the set.

        What the best one has besides may then be of another effect beside either: of an encoder that is off, where
        objects are smaller than the set says, which is backlash that differs by finger. So that is for the next step.
        Only where it leaves more than noise, and the simpler one explains enough.

        Args:
          ordered: candidates, the best first.

        Returns:
          The candidate, and the names of those that it was preferred to.
        """
        best, *others = ordered
        of_set = [c for c in others if c.effect.of_set]
        if best.replaces or not of_set or rms_error(best.fit, self._study.target) <= ALL_FITTED:
            return best, set()
        for simpler in others:
            enough = families.is_richer(best.effect, simpler.effect) and self._start.shows(simpler)
            if enough and any(indistinguishable(simpler, c) for c in of_set):
                (first,) = self._at_the_end([simpler], {simpler.effect.name: []})
                return first, {best.effect.name}
        return best, set()

    def _may_be_a_look_alike(self, best: Candidate) -> bool:
        """Whether an effect that was found leaves more than noise."""
        leaves_more = rms_error(best.fit, self._study.target) > ALL_FITTED
        return leaves_more and not (self._start.place(best)[0] or best.replaces or best.effect.of_set)

    def _mistakes_instead(
        self, best: Candidate, candidates: Sequence[Candidate], at_the_end: Collection[str]
    ) -> list[Candidate]:
        """Rough fits with mistakes of the set that gained nearly as much as an effect at its end.

        Radii that are too large do as well as backlash, once other parameters have followed: neither is to be named
        because the other was not fitted as far. Arguments as for :meth:`_rivals`.
        """
        if best.replaces or best.effect.of_set or self._start.place(best)[0]:
            return []
        return [c for c in self._rivals(best, candidates, at_the_end) if c.effect.of_set]

    def _rivals(self, best: Candidate, candidates: Sequence[Candidate], at_the_end: Collection[str]) -> list[Candidate]:
        """Rough fits that gained nearly as much as one that leaves more than noise at the end.

        Of a lighter object and a softer damper of its contacts the wrong one may be ahead of the other roughly, where
        other parameters have not followed yet.

        Args:
          best: what was fitted to the end.
          candidates: all there are.
          at_the_end: names of those that were fitted to the end, too.
        """
        rough = [c for c in candidates if c.effect.name not in at_the_end and not c.replaces]
        # what contains it takes its place in the next step, if it earns that
        rough = [c for c in rough if not families.is_richer(c.effect, best.effect)]
        least = LOST_IF_FITTED * (self._fit.cost - best.fit.cost)
        return [c for c in rough if self._fit.cost - c.fit.cost > least]

    def _leads_further(self, rough: Candidate, fit: Fit, name: str) -> bool:
        """Whether a rough fit comes to less than another model, on few grasps."""
        some, part = self._study.on_few(fit)
        own = self._study.on_few(rough.fit)[1]
        self._study.progress(f"holding {rough.effect.name} against {name} on few grasps")
        return fit_exactly(some.target, own.problem, some.simulators, own.vector).cost < NO_BETTER * part.cost

    def _better_look_alikes(self, best: Candidate, effects: Sequence[type[Effect]]) -> list[Candidate]:
        """Rough fits with look-alikes of one in its place, those that leave less than it does on few grasps.

        Of two kinds of friction the wrong one may have the better signature by far, where both are to grow much larger
        than signatures are. Where the best one is fitted, the others start from what it has found. One that explains
        little may be of the wrong family, too.

        Args:
          best: a candidate that was fitted to the end.
          effects: that may be in its place.
        """
        own = best.effect
        alike = families.look_alikes_of(own, effects, of_any_family=best.share < EXPLAINED_FAR)
        alike = [effect for effect in alike if not families.is_richer(effect, own)]
        return self._in_its_place(best, alike)

    def _instead_of_set(self, best: Candidate, effects: Sequence[type[Effect]]) -> list[Candidate]:
        """Rough fits with look-alikes in the place of a mistake of the set, those that leave as little on few grasps.

        A set is not to be called wrong where the gripper may be what differs, however little a signature promised: of
        backlash behind motors whose effort is read, it is next to nothing.

        Args:
          best: a mistake of the set that was fitted to the end.
          effects: that may be in its place.
        """
        alike = families.look_alikes_of(best.effect, effects, of_any_family=True)
        return self._in_its_place(best, alike, AS_GOOD)

    def _in_its_place(self, best: Candidate, alike: Sequence[type[Effect]], most: float = NO_BETTER) -> list[Candidate]:
        """Rough fits with these effects in one's place, those that leave at most so much of what it leaves."""
        name = best.effect.name
        for effect in alike:
            self._study.progress(f"trying {effect.name} in place of {name}")
        return [
            self._start.judge_by_gain(fit, self._null)
            for fit in refine_anyway(alike, self._study, best.fit, name, most)
        ]

    def _is_enough(self, simple: Candidate, rough: Mapping[str, Fit], richer: Candidate) -> bool:
        """Whether a richer effect promises nothing beyond one that it contains, which leaves only noise."""
        return (
            any(nested.effect == simple.effect.name for nested in richer.effect.contains)
            and richer.fit.cost > NO_BETTER * rough[simple.effect.name].cost
            and not excess(self._study.heldout(simple.fit), self._study.numerical, self._study.target)
        )

    def _compare_with_contained(self, candidates: Sequence[Candidate]) -> list[Candidate]:
        """Refits effects that fit worse than one that they contain, and the one that they have become."""
        found = {c.effect.name: c for c in candidates}
        for c in candidates:
            for nested in () if c.replaces else c.effect.contains:
                member = found.get(nested.effect)
                if member is not None and families.stalled(c.fit, member.fit):
                    again = families.refit_as_richer(c.effect, member.fit, nested.effect, self._study)
                    c = found[c.effect.name] = self._start.judge(
                        min(again, c.fit, key=lambda f: f.cost), c.p_family, c.signature
                    )
                elif families.falls_back(c.fit, nested):
                    setting = families.simpler(c.setting, nested, c.fit.problem.gripper)
                    fallen = families.refit_as(setting, c.fit, c.effect.name, self._study)
                    if member is None or fallen.cost < member.fit.cost:
                        found[nested.effect] = self._start.judge(fallen, c.p_family, c.signature)
        return list(found.values())

    def _at_the_end(self, candidates: Sequence[Candidate], alike: Mapping[str, Sequence[Candidate]]) -> list[Candidate]:
        """The candidates once they are fitted to the end, each of them the best of its variants there.

        Args:
          candidates: the best variants of some effects.
          alike: the other variants that are to be fitted to the end, by effect.
        """
        fitted = [c for c in candidates if not c.replaces]  # the others were fitted to the end already
        every = [one for c in fitted for one in (c, *alike[c.effect.name])]
        tasks = [
            self._study.telling(
                f"{one.setting.title}, to the end", partial(to_the_end, one.fit, self._study), self._fit
            )
            for one in every
        ]
        ends = list(zip(side_by_side(tasks), every, strict=True))
        judged = {}
        for c in fitted:
            fit, best = min((end for end in ends if end[1].effect is c.effect), key=lambda end: end[0].cost)
            judged[c.effect.name] = self._start.judge(fit, best.p_family, best.signature)
        return [judged.get(c.effect.name, c) for c in candidates]
