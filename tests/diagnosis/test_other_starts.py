"""Where else a fit may start: what rings at one frequency has valleys at others."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.diagnosis.search.other_starts import other_starts
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.cross_validation import make_folds
from forcegrasp.identify.fit import fit_exactly
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.problem import Problem
from tests.diagnosis.test_families import jaw_with, silent


def test_a_frequency_is_also_tried_elsewhere():
    """Of 4 and 12 Hz, where the effect is looked for, the one that is far from where the fit ended."""
    loaded = jaw_with("elastic_transmission", load_share=0.5, frequency_hz=5.0)
    target, simulators, base = fit_model(loaded, 0, silent)
    setting = EffectSetting(effect_of("elastic_transmission", loaded.gripper), "", np.array([0.3, 5.0]))
    problem = Problem(loaded.gripper, target.grasps, [setting])
    fit = fit_exactly(target, problem, simulators, np.r_[base.fit.vector, problem.start()[len(base.fit.vector) :]])
    starts = other_starts(fit, Study(target, simulators, make_folds(target.grasps)))
    elsewhere = [start for start in starts if problem.values(start)[-1] == pytest.approx(12.0)]
    assert len(elsewhere) == 1
    np.testing.assert_array_equal(elsewhere[0][:-1], fit.vector[:-1])
    assert not any(problem.values(start)[-1] == pytest.approx(4.0) for start in starts)
