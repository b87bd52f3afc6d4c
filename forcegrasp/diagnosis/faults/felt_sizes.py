"""Objects that fingers met elsewhere than a model's do, where they met the others as those."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.identify.fit import Fit
from forcegrasp.identify.initial_guess import felt
from forcegrasp.identify.target import Target

# With fewer objects nobody tells which one is wrong.
_LEAST_OBJECTS = 3
# An object is doubted if it was met so many standard errors, and standard deviations of what is given, from where the
# others say. One touch of it is not enough.
_FAR, _BEYOND_TOLERANCE, _LEAST_TOUCHES = 4.0, 3.0, 2
#: Nearer than this no contact is seen between two samples, metres.
SEEN_M = 3e-4
# Median of absolute deviations → standard deviation of normal ones.
_NORMAL = 1.4826


def doubtful_radii(target: Target, fit: Fit, radius_std_m: float) -> dict[str, float]:
    """The objects whose given radius fingers did not find, and that radius; none if most were met elsewhere.

    Where a model with the radii as given meets them is what the fingers should have said: soft objects are felt late.

    Args:
      target: grasps of a gripper.
      fit: of the base model.
      radius_std_m: standard deviation of given radii, metres.
    """
    said = np.array([np.nan if grasp.radius_m is None else grasp.radius_m for grasp in target.grasps])
    labels = np.array([grasp.object for grasp in target.grasps])
    off = felt(target)[0] - felt(_as_predicted(target, fit))[0]
    off[np.isnan(said)] = np.nan
    of_object = {name: off[(labels == name) & np.isfinite(off)] for name in target.objects}
    of_object = {name: values for name, values in of_object.items() if len(values)}
    if len(of_object) < _LEAST_OBJECTS:
        return {}
    middle = {name: float(np.median(values)) for name, values in of_object.items()}
    usual = float(np.median(list(middle.values())))
    several = [values - np.median(values) for values in of_object.values() if len(values) >= _LEAST_TOUCHES]
    scatter = _NORMAL * float(np.median(np.abs(np.concatenate(several)))) if several else np.inf
    least = max(_BEYOND_TOLERANCE * radius_std_m, SEEN_M)
    found = {
        name: float(np.nanmedian(said[labels == name]))
        for name, values in of_object.items()
        if len(values) >= _LEAST_TOUCHES
        and abs(middle[name] - usual) > max(_FAR * scatter / np.sqrt(len(values)), least)
    }
    return found if 2 * len(found) < len(of_object) else {}


def _as_predicted(target: Target, fit: Fit) -> Target:
    """The grasps with readings as a fit has them."""
    position, force = (target.axis.kinds[kind] for kind in ("position", "force"))
    grasps = tuple(
        dataclasses.replace(
            grasp,
            position_m=fit.predicted[index, : len(grasp.time_s), position],
            force_n=fit.predicted[index, : len(grasp.time_s), force],
        )
        for index, grasp in enumerate(target.grasps)
    )
    return dataclasses.replace(target, grasps=grasps)
