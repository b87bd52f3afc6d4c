"""Which models are asked whether a move of what the set gives explains what they leave."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from forcegrasp.diagnosis.moved_set import _models
from tests.diagnosis.test_ask_again import DEADBAND, FRICTION, LAG, names_in, rubbing, tied  # noqa: F401 a fixture


def test_a_rival_is_asked_in_the_place_of_what_it_can_not_be_told_from(rubbing):  # noqa: F811
    study, steps, fit = tied(rubbing, FRICTION, DEADBAND)
    found = SimpleNamespace(fit=fit, steps=steps, target=study.target, folds=study.folds)
    (own, as_found), (rival, other) = _models(found)
    assert own is fit
    assert as_found == steps
    assert names_in(rival) == {DEADBAND, LAG}
    assert rival.cost > own.cost
    assert other[0].effects == (DEADBAND, FRICTION)
    assert [c.effect.name for c in other[0].candidates] == [DEADBAND, FRICTION]
    assert other[1] is steps[1]


@pytest.mark.parametrize("rivals", [(FRICTION,), (FRICTION, LAG)])
def test_what_is_alone_or_in_the_model_already_has_no_rival_to_ask(rubbing, rivals):  # noqa: F811
    study, steps, fit = tied(rubbing, *rivals)
    found = SimpleNamespace(fit=fit, steps=steps, target=study.target, folds=study.folds)
    assert [one for one, _ in _models(found)] == [fit]
