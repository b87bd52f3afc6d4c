"""Objects that are all smaller look like backlash: where radii were moved so, it is tried beside them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis.faults.fault import Fault
from forcegrasp.diagnosis.faults.tolerance import Moved, _limits
from forcegrasp.diagnosis.givens.lost_motion import with_lost_motion
from forcegrasp.diagnosis.givens.moved_set import _Model, _with_lost_motion
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects import get_effect
from forcegrasp.identify.cross_validation import evidence_folds
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.givens import Given, givens_of
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import make_target
from tests.light_set import light_set

GAP_M, OFF_M = 0.0015, {"thing_0": 3e-4, "thing_1": -3e-4, "thing_2": 3e-4}


def silent(text: str) -> None:
    """Takes what a search tells about its progress."""


def test_each_of_many_places_may_be_further_off_than_one_radius():
    of_all = np.ones(24, bool)
    places = [Given("offset_m", f"g{i}", 5e-4, of_all) for i in range(24)]
    radius = Given("radius_m", "cup", 3e-4, of_all)
    limits = _limits([radius, *places])
    assert limits[0] == 3.0
    assert limits[1:] == pytest.approx(3.86, abs=0.01)
    assert Moved((radius, *places), np.r_[2.9, 3.5, np.zeros(23)]).is_within
    assert not Moved((radius, *places), np.r_[3.1, np.zeros(24)]).is_within
    assert not Moved((places[0],), np.array([3.1])).is_within


@pytest.fixture(scope="module")
def loose():
    """A set with backlash, whose radii are a little off; and a model fitted to it with all radii moved down."""
    loaded = light_set(f"backlash loose gap_m={GAP_M}", seed=4, grasps=12)
    loaded = with_grasps(loaded, lambda g: dataclasses.replace(g, radius_m=g.radius_m + OFF_M.get(g.object, 0.0)))
    loaded = dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, radius_std_m=3e-4))
    numbers = givens_of(loaded.measured, make_target(loaded.measured, loaded.gripper))
    radii = tuple(number for number in numbers if number.kind == "radius_m")
    down = Moved(radii, np.array([(-GAP_M / 2 - OFF_M.get(number.owner, 0.0)) / 3e-4 for number in radii]))
    fitted = with_grasps(loaded, down.put)
    target, _, base = fit_model(fitted, 0, silent)
    fault = Fault("object_tolerance", down.words(), down.check, fitted, down)
    return loaded, _Model(base.fit, target, [], fault=fault), down


def with_grasps(loaded, change):
    grasps = tuple(change(grasp) for grasp in loaded.measured.grasps)
    return dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=grasps))


@pytest.mark.long
@pytest.mark.parametrize(("up_m", "names"), [(0.0, ["backlash"]), (2e-3, [])])
def test_it_is_tried_where_radii_were_moved_down(loose, up_m, names):
    loaded, moved, down = loose
    catalogue = [get_effect(name) for name in ("force_bias", "backlash", "command_deadband")]
    tried = with_lost_motion(moved.fit, moved.target, down.with_radii_raised(up_m), loaded.measured, catalogue, silent)
    found = list(tried)
    assert [fit.effects[-1].effect.name for fit, _ in found] == names
    for _, raised in found:  # what is left of the moves is what each radius is off
        assert np.mean(list(raised.moves.values())) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.long
def test_what_moved_radii_had_taken_is_given_back(loose):
    """The radii, moved down, stand for backlash; with that in the model they are moved to where they are."""
    loaded, moved, _ = loose
    study = Study(moved.target, Simulators(moved.fit.problem), evidence_folds(moved.target.grasps))
    lost = _with_lost_motion(moved, loaded, [get_effect("backlash")], study)
    assert lost is not None
    (step,) = lost.steps
    assert step.effects == ("backlash",)
    assert step.candidates[0].without is moved.fit
    assert max(step.error_after, step.error_before) < 1.02  # readings have no preference; what is given has
    assert lost.price < moved.price - 20
    assert lost.fit.effect("backlash").values[0] == pytest.approx(GAP_M, rel=0.25)  # the two trade
    moves = lost.fault.moved.moves  # pyright: ignore[reportOptionalMemberAccess]
    assert abs(np.mean([move for name, move in moves.items() if name.startswith("radius")])) < 2e-4 < GAP_M / 2
