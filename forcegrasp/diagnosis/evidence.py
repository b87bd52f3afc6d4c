"""Whether held-out grasps show an effect, and whether they can tell it from another."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from forcegrasp.diagnosis import families
from forcegrasp.diagnosis.result import Candidate, Step
from forcegrasp.diagnosis.verdict import LEAST_SHARE
from forcegrasp.identify.fit import Fit

#: Family-wise probability of a false alarm that is accepted at each step.
ALARM = 0.01
#: One of many effects may explain less than `LEAST_SHARE`; it is believed if all of them together leave nothing, or
#: explain this share.
LEAST_SHARE_OF_MANY, LEAST_SHARE_TOGETHER = 0.1, 0.75
#: A change of the held-out log-likelihood below this is no evidence, however even it is.
LEAST_RISE = 5.0
# Effects whose signatures are that parallel, and that gain this share of each other, can't be told apart, whatever the
# likelihood says. Signatures are of small sizes: fitted, one may explain what the other can't.
_PARALLEL, _ALIKE = 0.995, 0.9
# An effect with fewer parameters that gains this share of what the best one gains can't be ruled out.
_NEARLY = 0.95
# Nor can, of an effect and a mistake of the set that gain nearly the same, the one that leaves less than so many times
# what the other leaves: what the model still lacks may decide between them.
_AS_MUCH = 2.0
# One that explains less than this share of what the best one explains is no rival of it.
_HALF = 0.5
# Nor is one whose fit of all grasps leaves so many times what the other's leaves: where few grasps hold an object,
# held-out ones say little. Rough fits end far nearer.
_FITS_WORSE = 1.5
# Where held-out grasps do not tell, one of as many parameters that leaves so many times less of all is the better one.
_FITS_BETTER = 1.2
# So many grasps at least may show an effect without the one that gains most.
_AGREE = 6
#: Between an effect and a fault of the set a lead below this decides nothing: to take one for the other costs most.
LEAST_LEAD = 10.0


def is_significant(
    candidate: Candidate, least_gain: float, least_share: float = LEAST_SHARE, errors: float = 1.0
) -> bool:
    """Whether noise would hardly do as well.

    Args:
      candidate: an effect.
      least_gain: the share by which some signal's error must fall.
      least_share: the share of the mean square beyond the noise that it must explain.
      errors: how many of its standard errors the held-out gain must have.
    """
    return (
        candidate.p_family <= ALARM
        and candidate.is_plausible
        and (_is_shown_by_all(candidate.evidence, errors) or _shows_in_some(candidate, errors))
        and candidate.largest_fall >= least_gain
        and candidate.share >= least_share
    )


def may_be_besides(steps: Sequence[Step]) -> Candidate | None:
    """What a search ended with, if noise would hardly do as well: too little of what is left to be an answer."""
    if not steps or steps[-1].effects or not steps[-1].candidates:
        return None
    best = steps[-1].candidates[0]
    return best if not best.replaces and is_significant(best, 0.0, LEAST_SHARE_OF_MANY) else None


def _is_shown_by_all(gains: np.ndarray, errors: float) -> bool:
    """Whether all grasps together gain beyond chance, ``(G,)``, or all but the one that gains most.

    One that gains far more than the others makes these scatter so much that nothing seems sure, though they agree.
    """
    return any(is_beyond_chance(some, LEAST_RISE, errors) for some in (gains, _but_for_one(gains)))


def _but_for_one(gains: np.ndarray) -> np.ndarray:
    """Gains without the largest, if there are enough of them."""
    gains = gains[np.isfinite(gains)]
    return np.delete(gains, np.argmax(gains)) if len(gains) > _AGREE else gains


def _shows_in_some(candidate: Candidate, errors: float) -> bool:
    """Whether the windows of some recordings are surely better with an effect, and no recording surely worse."""
    return is_beyond_chance(candidate.gains, LEAST_RISE, errors) and not candidate.harms


def indistinguishable(winner: Candidate, other: Candidate) -> bool:
    """Whether these data can't tell another effect from the best one."""
    parallel = abs(float(winner.signature @ other.signature)) > _PARALLEL
    alike = parallel and other.heldout_gain > _ALIKE * winner.heldout_gain
    simpler = len(other.effect.parameters) < len(winner.effect.parameters)
    nearly = simpler and nearly_as_much(other.heldout_gain, winner.heldout_gain)
    # it may be there besides, and not instead
    if other.share < min(LEAST_SHARE, _HALF * winner.share) or not other.is_plausible:
        return False
    if other.fit.cost > _FITS_WORSE * winner.fit.cost:
        return False
    differ = winner.effect.of_set != other.effect.of_set  # one is of the gripper, one of the set
    much_left = other.heldout_gain > _ALIKE * winner.heldout_gain and 1 - other.share < _AS_MUCH * (1 - winner.share)
    least = LEAST_LEAD if differ else 0.0
    return other.heldout_gain > 0 and (not _leads(winner, other, least) or alike or nearly or (differ and much_left))


def with_close_rivals(step: Step) -> Step:
    """A step with those among its effects, too, that gain nearly as much as the first, or leave no more.

    For where much is left: what the model still lacks may have decided between them. Effects that contain each other
    are no rivals, they were told apart by what the richer one adds.
    """
    if not step.effects or not step.candidates or step.replaces:
        return step
    winner, known = step.candidates[0], len(step.effects)
    close = [
        c for c in step.candidates[known:]
        if c.is_plausible
        and (c.heldout_gain > _ALIKE * winner.heldout_gain or c.error_after <= winner.error_after)
        and c.fit.cost <= _FITS_WORSE * winner.fit.cost
        and not families.contain(c.effect, winner.effect)
    ]  # fmt: skip
    others = [c for c in step.candidates[known:] if c not in close]
    names = tuple(c.effect.name for c in close)
    return dataclasses.replace(
        step, effects=(*step.effects, *names), candidates=(*step.candidates[:known], *close, *others)
    )


def rivals_in(step: Step, fit: Fit) -> list[Candidate]:
    """The effects that a step could not tell from its first one, and that may take its place in a model."""
    own, *names = step.effects
    others = [one.effect for one in fit.problem.effects if one.effect.name != own]
    return [c for c in step.candidates[1:] if c.effect.name in names and families.may_join(c.effect, others)]


def add_nothing(candidates: Sequence[Candidate], enough: float = 0.0) -> set[str]:
    """Names of effects that contain another one of which held-out grasps say that it is enough, or nearly so.

    Or that have become it, can't be told from it, or fit all grasps no better: what they gain then is a quirk of how
    they are simulated, or of held-out predictions, which are linear.

    Args:
      candidates: of which some contain others.
      enough: sum of squares that only noise leaves; of much error a simpler one that leaves more gains nearly as much.
    """
    found = {c.effect.name: c for c in candidates}
    return {
        c.effect.name
        for c in candidates
        for nested in c.effect.contains
        if (simple := found.get(nested.effect)) is not None
        and (
            not _leads(c, simple)
            or (nearly_as_much(simple.heldout_gain, c.heldout_gain) and not _leaves_less(c, simple, enough))
            or families.is_the_simpler(c.setting, nested)
            or families.falls_back(c.fit, nested)
            or families.fits_as_well(simple.fit, c.fit)
        )
    }


def outdone(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Those that leave more of all grasps than another with no more parameters, and gain more of one at most.

    One grasp may hold an object's stiffness alone, and the other grasps of that object ask for another one as long as
    an effect is missing: what is held out then tells of that grasp, and the effect that fits all best gains least.
    """

    def better(other: Candidate, one: Candidate) -> bool:
        no_richer = other.replaces == one.replaces and len(other.fit.problem) <= len(one.fit.problem)
        leads = is_beyond_chance(_but_for_one(one.evidence - other.evidence), 0.0)
        return no_richer and one.fit.cost > _FITS_BETTER * other.fit.cost and not leads

    return [one for one in candidates if any(better(other, one) for other in candidates)]


def nearly_as_much(gain: float, other: float) -> bool:
    """Whether an effect gains so nearly what a richer one gains that what that has besides is not worth naming."""
    return gain > _NEARLY * other


def _leaves_less(richer: Candidate, simple: Candidate, enough: float) -> bool:
    """Whether one leaves only noise, and the other far more."""
    return richer.fit.cost < enough and simple.fit.cost > _FITS_WORSE * richer.fit.cost


def _leads(winner: Candidate, other: Candidate, least: float = 0.0) -> bool:
    """Whether the difference of what two effects gain is beyond its standard error, and beyond ``least``."""
    return is_beyond_chance(winner.evidence - other.evidence, least)


def is_beyond_chance(gains: np.ndarray, least: float, errors: float = 1.0) -> bool:
    """Whether the sum of what grasps gain, ``(G,)``, is beyond so many of its standard errors, and beyond ``least``."""
    gains = gains[np.isfinite(gains)]
    error = gains.std(ddof=1) * np.sqrt(len(gains)) if len(gains) > 1 else np.inf
    return bool(gains.sum() > max(errors * error, least))
