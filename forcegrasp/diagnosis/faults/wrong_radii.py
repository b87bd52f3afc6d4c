"""Radii, and all else that is given with a tolerance, that readings put elsewhere than the set does."""

from __future__ import annotations

import dataclasses

from forcegrasp.diagnosis.faults.fault import Fault, with_each
from forcegrasp.diagnosis.faults.tolerance import MOST, WORTH, Moved, move_given
from forcegrasp.diagnosis.verdict import LEAST_SHARE
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.target import Target
from forcegrasp.measure.schema import MeasurementSet


def wrong_radii(loaded: Loaded[MeasurementSet], wrong: dict[str, float], moved: Moved | None) -> Fault:
    """Given radii, by object, are to be fitted instead, from where they are moved to."""
    words = f"fingers met {listed(list(wrong))} elsewhere than the set says"
    right = with_each(loaded, lambda _, g: dataclasses.replace(g, radius_m=None) if g.object in wrong else g)
    check = f"the radius of {listed(list(wrong))}, with a calliper: it may be another object's, or a diameter"
    fitted = {f"radius_m of {name}": said for name, said in wrong.items()}
    # what fingers felt is seen in the readings themselves: as much is enough as of an effect
    moves = {} if moved is None else moved.moves
    return Fault("object_radius", words, check, right, fitted=fitted, moves=moves, worth=LEAST_SHARE)


def most_radii(loaded: Loaded[MeasurementSet], moved: Moved) -> Fault | None:
    """Radii that are beyond their tolerance, some more and some less."""
    measured, apart = loaded.measured, moved.radii_apart()
    said = {g.object: g.radius_m for g in measured.grasps if g.object in apart and g.radius_m is not None}
    if not said:
        return None
    check = "the radii, with a calliper; were they measured by a ruler, meta.yaml may say object_radius_std_m"
    most = dataclasses.replace(wrong_radii(loaded, said, moved), check=check, of_most=True)
    return dataclasses.replace(most, least=MOST * measured.radius_std_m)


def within_tolerance(
    loaded: Loaded[MeasurementSet], target: Target, fit: Fit, worth: float = WORTH, start: Moved | None = None
) -> Fault | None:
    """What was moved within the tolerance of what is given, if that explains this share of what a fit leaves.

    Args:
      loaded: grasps of a gripper, as the set has them.
      target: the same, lined up.
      fit: of the model.
      worth: least share of the squares beyond the noise.
      start: moves from which the fit started already.
    """
    moved = move_given(loaded.measured, target, fit, worth, start)
    return None if moved is None else moved_as_fault(loaded, moved)


def moved_as_fault(loaded: Loaded[MeasurementSet], moved: Moved) -> Fault:
    """A set whose givens were moved within their tolerance, which is no fault."""
    name, right = f"{'_and_'.join(moved.groups)}_tolerance", with_each(loaded, lambda _, g: moved.put(g))
    return Fault(name, moved.words(), moved.check, right, moved)
