"""Two effects take the place of one that looks like their sum."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.diagnosis.families import roughly_without
from forcegrasp.diagnosis.few import with_few
from forcegrasp.diagnosis.search.screen import Screen
from forcegrasp.diagnosis.search.split import split
from forcegrasp.diagnosis.search.step import look_further
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.identify.cross_validation import make_folds
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.noise_floor import beyond_fit, numerical_error
from forcegrasp.identify.progress import silent
from tests.light_set import light_gripper, light_set

# what comes late, and a little besides
CATALOGUE = [
    effect_of(name, light_gripper())
    for name in (
        "command_delay", "actuator_lag", "force_lag", "force_delay", "readout_skew",
    )
]  # fmt: skip
DELAY = CATALOGUE[0]


def split_delay(*hidden: str):
    """What takes the place of a late command in a set with these effects hidden; and the step that had found it."""
    loaded = light_set(*hidden, grasps=9, samples=54)
    target, simulators, base = fit_model(loaded, 0, silent)
    numerical = beyond_fit(base.fit, numerical_error(base.fit, target))
    study = with_few(Study(target, simulators, make_folds(target.grasps), numerical), base.fit)
    screen, rng = Screen(CATALOGUE, study), np.random.default_rng(0)
    step = look_further(study, base.fit, screen, CATALOGUE, rng)
    assert step.effects[0] == "command_delay"
    others = [e for e in CATALOGUE if e is not DELAY]
    return split(study, step.candidates[0].fit, screen, others, [step], rng), step, study


@pytest.mark.long
def test_positions_and_forces_late_in_their_own_ways_are_no_late_command():
    found, old, study = split_delay("readout_skew delay_s=0.03", "force_lag time_constant_s=0.03")
    assert found is not None
    (first,), second = found
    assert (first.effects, second.effects) == (("readout_skew",), ("force_lag",))
    assert first.replaces == "command_delay"
    assert [c.effect.name for c in first.candidates].count("readout_skew") == 1
    fit = second.candidates[0].fit
    assert [one.effect.name for one in fit.problem.effects] == ["readout_skew", "force_lag"]
    sizes = [one.values[0] for one in fit.problem.case(fit.vector).effects]
    assert sizes == pytest.approx([0.03, 0.03], abs=0.003)
    assert first.candidates[0].setting.values[0] == sizes[0]
    assert first.error_before == old.error_before > first.error_after == second.error_before > second.error_after
    assert first.candidates[0].error_after == first.error_after
    assert 0 < first.candidates[0].heldout_gain < old.candidates[0].heldout_gain  # its own, not the late command's
    assert 0 < first.candidates[0].share < old.candidates[0].share
    assert second.error_after < 1.05 < old.error_after
    alone = roughly_without("force_lag", fit, study)
    assert first.error_after == pytest.approx(study.error(study.heldout(alone)), rel=0.1)


@pytest.mark.long
def test_a_late_command_stays():
    assert split_delay("command_delay delay_s=0.03")[0] is None
