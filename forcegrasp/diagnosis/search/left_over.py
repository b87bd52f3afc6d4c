"""Whether a model leaves more than noise, and where."""

from __future__ import annotations

import numpy as np

from forcegrasp.diagnosis.noise.noise_check import Noise, unexpected_noise
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import MUCH, explained_share
from forcegrasp.identify.cross_validation import rms_of_grasps
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.noise_floor import excess, numerical_floor

# Of so many grasps one alone says nothing of the gripper: where fingers push an object is a matter of chance.
_MANY = 12
#: Where the base fit stopped short, parameters are a little off: so many times the floor is as good as nothing left.
AS_GOOD_AS_NOTHING = 1.1
# If that is also less than this share of what was beyond the floor, effects that were found are nearly right, and what
# takes the rest makes up for their forms: behind a lag, in another engine's contacts, objects were ten times too light.
_LITTLE = 0.1
# Held-out readings that scatter by so many times the floor at most are no larger than noise was said to be.
_NO_LARGER = 1.02
# What effects leave of the mean square beyond the floor is of their forms if it is no more than this share.
_OF_FORMS = 0.02


def left_over(study: Study, fit: Fit) -> tuple[str, Noise | None]:
    """Where held-out residuals are more than noise, in words; and the noise, if it is not as assumed."""
    held = study.heldout(fit)
    noise = unexpected_noise(held, study.numerical, study.target, fit.predicted)
    # where a fit of all grasps leaves nothing no effect is missing, nor is noise larger: others say too little of a
    # held-out one's object, or with their parameters it goes another way
    if not excess(fit.residual, study.numerical, study.target):
        return "", None if noise and noise.stronger else noise
    return ("" if noise else excess(held, study.numerical, study.target)), noise


def left_by_many(study: Study, fit: Fit) -> tuple[str, Noise | None, str]:
    """The same where no single grasp shows it; and what one shows, in words, where all others show noise alone."""
    (left, noise), target = left_over(study, fit), study.target
    if not left or target.gripper.is_servo or len(target.grasps) < _MANY:
        return left, noise, ""
    held = study.heldout(fit)
    for index in np.argsort(-np.nansum(held**2, axis=(1, 2))):
        others = held.copy()
        others[index] = np.nan
        noise = unexpected_noise(others, study.numerical, target, fit.predicted)
        if noise is not None or not excess(others, study.numerical, target):
            grasp, error = target.grasps[index], rms_of_grasps(fit.residual, target)[index]
            return "", noise, f"grasp {grasp.name} of {grasp.object} ({error:.2f} × noise)"
    return left, None, ""


def leaves_more_than_noise(study: Study, fit: Fit) -> bool:
    """Whether a model leaves what no noise does, however strong, in more than a single grasp."""
    return bool(left_by_many(study, fit)[0])


def is_worth_looking(study: Study, fit: Fit) -> bool:
    """Whether a model leaves more than noise, or what seems to be stronger noise: only that none is found tells."""
    left, noise = left_over(study, fit)
    return bool(left) or (noise is not None and noise.stronger and not has_tails_alone(study, fit, noise))


def may_lack_something(study: Study, fit: Fit) -> bool:
    """Whether a model without effects leaves anything to look for: more than the floor anywhere, or in all.

    What explains a part of less than that makes up for the simulation's own error.
    """
    left, noise = left_over(study, fit)
    if noise is not None:
        return not has_tails_alone(study, fit, noise)
    return bool(left) or study.error(study.heldout(fit)) > numerical_floor(study.numerical, study.target)


def has_tails_alone(study: Study, fit: Fit, noise: Noise | None) -> bool:
    """Whether all that is odd are heavy tails of noise that is no larger than it was said to be.

    What an effect gains there is too little to be worth a name, and may be of those tails.
    """
    least = max(1.0, numerical_floor(study.numerical, study.target))
    return noise is not None and noise.has_tails_alone and study.error(study.heldout(fit)) <= _NO_LARGER * least


def leaves_little(study: Study, fit: Fit, error_before: float, floor: float) -> bool:
    """Whether effects leave next to nothing, and little of what there was before them."""
    return _leaves_less(study, fit, error_before, floor, AS_GOOD_AS_NOTHING, _LITTLE)


def leaves_forms(study: Study, fit: Fit, error_before: float, floor: float) -> bool:
    """Whether effects leave so small a share of what there was that their forms, a little off, may well leave it.

    And not much: what is still missing would then be small, too, and small effects are as their signatures say.
    """
    return _leaves_less(study, fit, error_before, floor, MUCH, _OF_FORMS)


def _leaves_less(study: Study, fit: Fit, error_before: float, floor: float, times: float, share: float) -> bool:
    """Whether less is left than so many times the floor, and than this share of what was beyond it before."""
    error = study.error(study.heldout(fit))
    return error < times * floor and explained_share(error_before, error, noise=floor) > 1 - share
