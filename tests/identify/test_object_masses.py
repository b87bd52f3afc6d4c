"""Masses that a set gives of its objects."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.predict import predict
from forcegrasp.identify.problem import Problem
from forcegrasp.physics.gripper import MASS
from forcegrasp.replay.replay import Replay
from tests.light_set import light_set


def predicted(problem: Problem) -> np.ndarray:
    return predict(Replay(problem.gripper, problem.grasps), [problem.case(problem.start())])[0]


def test_objects_are_as_heavy_as_the_set_says():
    """Twice the scene's mass is what the effect of that name makes of it; what is not given stays as it is."""
    loaded = light_set(samples=30, grasps=4)
    gripper, grasps = loaded.gripper, loaded.measured.grasps
    scene = gripper.compile()
    double = 2 * float(scene.body_mass[scene.geom(gripper.object_geom).bodyid[0]])
    given = [dataclasses.replace(g, mass_kg=double if i != 1 else None) for i, g in enumerate(grasps)]
    problem = Problem(gripper, given)
    assert len(problem) == len(Problem(gripper, grasps))  # what is given is not fitted
    np.testing.assert_array_equal(problem.case(problem.start()).base[MASS], [double, np.nan, double, double])
    effect = EffectSetting(effect_of("object_mass", gripper), "", np.array([2.0]))
    plain, heavy, by_effect = (
        predicted(p) for p in (Problem(gripper, grasps), problem, Problem(gripper, grasps, [effect]))
    )
    kept = [0, 2, 3]
    np.testing.assert_allclose(heavy[kept], by_effect[kept], atol=1e-9)
    np.testing.assert_array_equal(heavy[1], plain[1])
    assert np.abs(heavy[kept] - plain[kept]).max() > 1e-3


@pytest.mark.parametrize("given", [True, False])
def test_no_mass_is_written_where_none_is_given(given):
    loaded = light_set(samples=10, grasps=2)
    grasps = [dataclasses.replace(g, mass_kg=0.2 if given else None) for g in loaded.measured.grasps]
    problem = Problem(loaded.gripper, grasps)
    assert (MASS in problem.case(problem.start()).base) == given
