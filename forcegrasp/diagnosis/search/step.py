"""One step of the search: refits with one more effect, judged on held-out grasps."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import partial

import numpy as np

from forcegrasp.diagnosis import families
from forcegrasp.diagnosis.evidence import (
    LEAST_SHARE_OF_MANY,
    add_nothing,
    indistinguishable,
    is_significant,
)
from forcegrasp.diagnosis.noise.noise_check import unexpected_noise
from forcegrasp.diagnosis.result import Candidate, Step
from forcegrasp.diagnosis.search.judge import LEAST_GAIN, LEAST_GAIN_AT_FLOOR, judged
from forcegrasp.diagnosis.search.refine import AS_GOOD, LOST_IF_FITTED, NO_BETTER, best_as_given, refine, refine_anyway
from forcegrasp.diagnosis.search.screen import MAX_GAIN_FACTOR, Screen
from forcegrasp.diagnosis.search.to_the_end import ALL_FITTED, to_the_end
from forcegrasp.diagnosis.signatures import Background, Score, best_effects, direction, of_best_effects
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import EXPLAINED_FAR, LEAST_SHARE, MUCH
from forcegrasp.effects import Effect
from forcegrasp.identify.base_fit import rms_error
from forcegrasp.identify.fit import Fit, fit_exactly
from forcegrasp.identify.noise_floor import excess
from forcegrasp.identify.side_by_side import side_by_side

# Beside effects that leave little its gain must be so many standard errors: a few grasps whose contacts went their own
# way may hold all that is left. What was there gained three or more, what was not 1.4 to 2.0.
_SURE = 2.0
# What all signatures together promise, so that effects that explain little each are tried: straight as they are, they
# promise less than effects explain, and what a set gives may be off besides.
_WORTH_A_TRIAL = 0.4
# Refitted per step: signatures only rank, and rank badly where an effect is large. So whatever promises this share of
# the best is refitted, too: contacts that press at once came sixth, with 0.7 of what larger objects promised.
_REFITTED, _NEAR_THE_BEST = 5, 0.5
# So many are, where none promises enough.
_FITTED_ANYWAY = 12
# And of those that leave least beside base parameters as given, where much is left.
_AS_GIVEN = 4
# Of these the best ones are fitted to the end.
_REFINED = 3
# Fitted to the end, the cost of a rough fit falls by this share of it at most, or of what the effect gained.
_FALLS, _GAINS_MORE = 0.2, 0.1


def look_further(
    study: Study,
    fit: Fit,
    screen: Screen,
    effects: Sequence[type[Effect]],
    rng: np.random.Generator,
    richer: Sequence[tuple[str, type[Effect]]] = (),
    most: float = np.inf,
    anyway: bool = False,
    least_promise: float = _WORTH_A_TRIAL,
    before: Sequence[Candidate] = (),
) -> Step:
    """Looks for one more effect.

    Args:
      study: the measurements.
      fit: with the effects that were found so far.
      screen: of the catalogue.
      effects: those that are not in the model.
      rng: for the null distribution.
      richer: names of effects in the model, each with one that contains it and may take its place.
      most: cost that a fit with the effect must come down to; one that is too far from it is not looked for.
      anyway: whether effects are fitted whose signatures promise too little: where parameters are far from where the
        effect would have them, slopes tell little of what it gains.
      least_promise: share that all signatures together must promise for an effect that explains little to be tried.
      before: what was fitted for another screen of this fit, best first: it is not fitted again.
    """
    start = _Start(study, fit)
    if effects:
        study.progress(f"trying {len(effects)} effects")
    look = screen.look(study, fit, start.background, effects, start.noise, rng)
    if anyway:
        tried = start.fit_anyway(look.scores, look.null)
        candidates = [one for one in tried if start.shows(one, LEAST_SHARE_OF_MANY)]  # signatures promised nothing
    else:
        near = [score for score in look.worth_a_fit if score.gain > _NEAR_THE_BEST * look.worth_a_fit[0].gain]
        count = max(_REFITTED, len({score.setting.effect for score in near}))
        fitted = {candidate.effect for candidate in before}
        best = of_best_effects(look.worth_a_fit, count)
        candidates = start.refit([score for score in best if score.setting.effect not in fitted], look.null)
    candidates = [one for one in candidates if _least_cost(one.fit, fit) < most]
    candidates += start.refit_richer(richer, look.null)
    variants: dict[str, list[Candidate]] = {}
    for candidate in sorted(candidates, key=start.place):
        variants.setdefault(candidate.effect.name, []).append(candidate)
    ordered, redundant = start.refine_on_reference_tier(list(variants.values()), effects, look.null)
    screens = sorted([some for some in (ordered, before) if some], key=lambda some: start.place(some[0]))
    ordered = tuple(candidate for some in screens for candidate in some)
    of_many = bool(ordered) and not start.shows(ordered[0])
    if not ordered or (of_many and not start.may_be_of_many(ordered[0], look.share_together, least_promise)):
        return Step((), ordered, look.scores, start.error, start.error)
    winner, later = start.simpler_first(ordered)
    others = [c for c in ordered if (c.effect, c.replaces) != (winner.effect, winner.replaces)]
    rivals = [c for c in others if c.effect.name not in redundant | later]
    # of those that can't be told apart the simplest comes first
    equal = sorted(
        [winner, *(c for c in rivals if indistinguishable(winner, c))],
        key=lambda c: len(c.effect.parameters),
    )
    ordered = (*equal, *(c for c in others if c not in equal))
    names = tuple(c.effect.name for c in equal)
    return Step(names, ordered, look.scores, start.error, equal[0].error_after, of_many)


def _least_cost(rough: Fit, without: Fit) -> float:
    """What a rough fit with an effect may come down to at the end, ``without`` being the fit without it."""
    return rough.cost - max(_FALLS * rough.cost, _GAINS_MORE * (without.cost - rough.cost))


def _as_good(best: Candidate, others: Sequence[Candidate]) -> list[Candidate]:
    """Those of the other variants of an effect that rough fits can't tell from the best one."""
    return [one for one in others if not one.replaces and NO_BETTER * one.fit.cost < best.fit.cost]


class _Start:
    """What a step starts from: a fit, and what it leaves.

    Args:
      study: the measurements.
      fit: with the effects that were found so far.
    """

    def __init__(self, study: Study, fit: Fit) -> None:
        self._study, self._fit = study, fit
        self.background = Background(fit, study.numerical)
        self.held = study.heldout(fit)  #: residuals of held-out grasps, ``(G, S, C)``
        self.error = study.error(self.held)
        self.noise = unexpected_noise(self.held, study.numerical, study.target, fit.predicted)
        left = excess(self.held, study.numerical, study.target)
        self.least_gain = LEAST_GAIN if left else LEAST_GAIN_AT_FLOOR
        beside_others = fit.problem.effects and self.error < MUCH and not study.target.gripper.is_servo
        self._least_errors = _SURE if beside_others else 1.0

    def shows(self, candidate: Candidate, least_share: float = LEAST_SHARE) -> bool:
        """Whether noise, or what a few grasps hold, would hardly do as well; see :func:`.evidence.is_significant`."""
        return is_significant(candidate, self.least_gain, least_share, self._least_errors)

    def place(self, candidate: Candidate) -> tuple[bool, float]:
        """What candidates are ordered by: a true effect that explains too little yet must not hide one that does."""
        return not self.shows(candidate), -candidate.heldout_gain

    def may_be_of_many(self, candidate: Candidate, share_together: float, least: float) -> bool:
        """Whether an effect that explains little is worth a trial: all signatures together must promise enough."""
        return self.shows(candidate, LEAST_SHARE_OF_MANY) and share_together >= least

    def refit(self, scores: Sequence[Score], null: np.ndarray) -> list[Candidate]:
        """Rough fits with one more effect, from where the best signatures put them."""
        candidates = []
        for one in refine(scores, self._study, self._fit, self.background):
            p_family = (1 + int(np.sum(null >= one.score.gain))) / (1 + len(null))
            candidates.append(self._judge(one.fit, p_family, one.score.signature))
        return candidates

    def refit_richer(self, richer: Sequence[tuple[str, type[Effect]]], null: np.ndarray) -> list[Candidate]:
        """Fits with effects in the place of those in the model that they contain."""
        pairs = richer if excess(self.held, self._study.numerical, self._study.target) else ()
        enough = side_by_side([partial(self._may_explain_enough, effect, name) for name, effect in pairs])
        pairs = [pair for pair, may in zip(pairs, enough, strict=True) if may]
        tasks = [
            self._study.telling(
                f"{effect.name} in place of {name}",
                partial(families.refit_as_richer, effect, self._fit, name, self._study),
            )
            for name, effect in pairs
        ]
        candidates = []
        for (name, effect), refit in zip(pairs, side_by_side(tasks), strict=True):
            if not any(families.falls_back(refit, nested) for nested in effect.contains):
                candidates.append(self._judge_by_gain(refit, null, name))
        return candidates

    def _may_explain_enough(self, richer: type[Effect], name: str) -> bool:
        """Whether few grasps let an effect gain enough in the place of one that it contains."""
        some, part = self._study.on_few(self._fit)
        if some is self._study:
            return True
        rough = families.roughly_as_richer(richer, part, name, some)
        return part.cost - rough.cost > MAX_GAIN_FACTOR * LEAST_SHARE * some.target.beyond_noise(part.residual)

    def _may_be_a_look_alike(self, best: Candidate) -> bool:
        """Whether an effect that was found leaves more than noise."""
        leaves_more = rms_error(best.fit, self._study.target) > ALL_FITTED
        return leaves_more and not (self.place(best)[0] or best.replaces or best.effect.of_set)

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
            enough = families.is_richer(best.effect, simpler.effect) and self.shows(simpler)
            if enough and any(indistinguishable(simpler, c) for c in of_set):
                (first,) = self._at_the_end([simpler], {simpler.effect.name: []})
                return first, {best.effect.name}
        return best, set()

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

    def _better_look_alikes(
        self, best: Candidate, effects: Sequence[type[Effect]], null: np.ndarray
    ) -> list[Candidate]:
        """Rough fits with look-alikes of one in its place, those that leave less than it does on few grasps.

        Of two kinds of friction the wrong one may have the better signature by far, where both are to grow much larger
        than signatures are. Where the best one is fitted, the others start from what it has found. One that explains
        little may be of the wrong family, too.

        Args:
          best: a candidate that was fitted to the end.
          effects: that may be in its place.
          null: gains of the best signature of noise.
        """
        own = best.effect
        alike = families.look_alikes_of(own, effects, of_any_family=best.share < EXPLAINED_FAR)
        alike = [effect for effect in alike if not families.is_richer(effect, own)]
        return self._in_its_place(best, alike, null)

    def _instead_of_set(self, best: Candidate, effects: Sequence[type[Effect]], null: np.ndarray) -> list[Candidate]:
        """Rough fits with look-alikes in the place of a mistake of the set, those that leave as little on few grasps.

        A set is not to be called wrong where the gripper may be what differs, however little a signature promised: of
        backlash behind motors whose effort is read, it is next to nothing.

        Args:
          best: a mistake of the set that was fitted to the end.
          effects: that may be in its place.
          null: gains of the best signature of noise.
        """
        alike = families.look_alikes_of(best.effect, effects, of_any_family=True)
        return self._in_its_place(best, alike, null, AS_GOOD)

    def _in_its_place(
        self, best: Candidate, alike: Sequence[type[Effect]], null: np.ndarray, most: float = NO_BETTER
    ) -> list[Candidate]:
        """Rough fits with these effects in one's place, those that leave at most so much of what it leaves."""
        name = best.effect.name
        for effect in alike:
            self._study.progress(f"trying {effect.name} in place of {name}")
        return [self._judge_by_gain(fit, null) for fit in refine_anyway(alike, self._study, best.fit, name, most)]

    def fit_anyway(self, scores: Sequence[Score], null: np.ndarray) -> list[Candidate]:
        """Rough fits with the effects of these signatures, whatever little they promise."""
        ordered = best_effects(scores, len(scores))
        # what takes the place of the scene's own law has no small size, and a signature that says little
        effects = [e for place, e in enumerate(ordered) if place < _FITTED_ANYWAY or e.instead_of]
        effects += [e for e in best_as_given(ordered, self._study, self._fit, _AS_GIVEN) if e not in effects]
        for effect in effects:
            self._study.progress(f"fitting {effect.name} to few grasps, though it promises little")
        return [self._judge_by_gain(fit, null) for fit in refine_anyway(effects, self._study, self._fit)]

    def refine_on_reference_tier(
        self, variants: Sequence[Sequence[Candidate]], effects: Sequence[type[Effect]], null: np.ndarray
    ) -> tuple[tuple[Candidate, ...], set[str]]:
        """Fits the best one, and those indistinguishable from it, on the reference tier: rough fits may stop short.

        Also returns the names of effects that add nothing to one that they contain.

        Args:
          variants: candidates of each effect, best first.
          effects: all that may be added.
          null: gains of the best signature of noise.
        """
        ordered = [of_effect[0] for of_effect in variants]  # of several variants the best one
        alike = {best.effect.name: _as_good(best, others) for best, *others in variants}
        near = [c for c in ordered if c is ordered[0] or indistinguishable(ordered[0], c)][:_REFINED]
        contained = {nested.effect for c in near for nested in c.effect.contains}
        simpler = [c for c in ordered if c.effect.name in contained and c not in near]
        least = min((c.fit.cost for c in near), default=np.inf)
        near += [c for c in simpler if _least_cost(c.fit, self._fit) < least]  # others can't do for what contains them
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
            redundant = add_nothing(every)
            every.sort(key=lambda c: (c.effect.name in redundant, *self.place(c)))
            first = every[0] if every else None
            if first is None:
                return (), redundant
            if first.effect.name not in names and not first.replaces:  # the last were fitted to the end already
                rough_ones = [c for c in every if c.effect.name not in names and not c.replaces]
                if names and not any(self.shows(c, LEAST_SHARE_OF_MANY) for c in rough_ones):
                    return tuple(every), redundant  # and no rough fit is worth more
                # fitted to the end the others are no better than this rough one: it is to be fitted, too
                names.add(first.effect.name)
                (every[0],) = self._at_the_end([first], alike)
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
                better = self._better_look_alikes(first, [e for e in effects if e not in fitted], null)
                alike |= {c.effect.name: [] for c in better}
                every += better
            elif first.effect.of_set and not first.replaces and first.effect.name not in doubted_of_set:
                doubted_of_set.add(first.effect.name)
                fitted = {c.effect for c in every}
                as_good = self._instead_of_set(first, [e for e in effects if e not in fitted], null)
                alike |= {c.effect.name: [] for c in as_good}
                every += as_good
            else:
                return tuple(every), redundant

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
                    c = found[c.effect.name] = self._judge(
                        min(again, c.fit, key=lambda f: f.cost), c.p_family, c.signature
                    )
                elif families.falls_back(c.fit, nested):
                    setting = families.simpler(c.setting, nested, c.fit.problem.gripper)
                    fallen = families.refit_as(setting, c.fit, c.effect.name, self._study)
                    if member is None or fallen.cost < member.fit.cost:
                        found[nested.effect] = self._judge(fallen, c.p_family, c.signature)
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
            self._study.telling(f"{one.setting.title}, to the end", partial(to_the_end, one.fit, self._study))
            for one in every
        ]
        ends = list(zip(side_by_side(tasks), every, strict=True))
        judged = {}
        for c in fitted:
            fit, best = min((end for end in ends if end[1].effect is c.effect), key=lambda end: end[0].cost)
            judged[c.effect.name] = self._judge(fit, best.p_family, best.signature)
        return [judged.get(c.effect.name, c) for c in candidates]

    def _judge_by_gain(self, refit: Fit, null: np.ndarray, replaces: str = "") -> Candidate:
        """The same of a fit that did not start from a signature."""
        p_family = (1 + int(np.sum(null >= self._fit.cost - refit.cost))) / (1 + len(null))
        return self._judge(refit, p_family, direction(self._fit, refit), replaces)

    def _judge(self, refit: Fit, p_family: float, signature: np.ndarray, replaces: str = "") -> Candidate:
        """What held-out grasps say of a fit with one more effect, its last one."""
        return judged(self._study, self.held, refit, refit.effects[-1], p_family, signature, replaces)
