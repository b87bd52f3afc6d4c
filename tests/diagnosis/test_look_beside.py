"""A fit that ended in a small valley beside the best size is led out of it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.diagnosis.result import Step
from forcegrasp.diagnosis.search import look_beside as module
from forcegrasp.diagnosis.search import search
from forcegrasp.diagnosis.search.look_beside import look_beside
from forcegrasp.identify.priors import Priors

TRUE, READINGS = 8.0, 50


def _fit(size: float, kind: str = "follows_motion") -> SimpleNamespace:
    """A fit that is stuck at a size: another parameter shifts all readings alike, which the size does not."""
    kinds = {name: name == kind for name in ("follows_motion", "in_steps", "in_valleys")}
    residual = np.linspace(-1, 1, READINGS).reshape(1, READINGS, 1) * 10 * (size - TRUE)
    return SimpleNamespace(
        problem=SimpleNamespace(
            effects=[SimpleNamespace(effect=SimpleNamespace(**kinds))],
            first_entry=lambda place: {0: 1}[place],
            entries=[
                None,
                SimpleNamespace(low=0.0, high=10.0, coordinate=lambda value: value, jumps=kinds["in_steps"]),
            ],
            case=lambda vector: vector,
            priors=Priors.none(2),
        ),
        vector=np.array([0.0, size]),
        values=np.array([0.0, size]),
        weight=np.ones((1, 1, 1)),
        residual=residual,
        slopes=np.ones((READINGS, 2)),
        jacobian=np.ones((1, READINGS, 1, 2)),
        correction=0.0,
        cost=float(np.sum(residual**2)),
    )


@pytest.fixture
def looked(monkeypatch) -> list[float]:
    """Sizes that were simulated."""
    seen: list[float] = []

    def predict(_, cases):
        seen.extend(case[1] for case in cases)
        return np.stack([_fit(case[1]).residual + 3.0 for case in cases])  # the other parameter makes up for the 3

    monkeypatch.setattr(module, "predict", predict)
    monkeypatch.setattr(module, "fit_exactly", lambda target, problem, simulators, start, slopes: _fit(start[1]))
    return seen


@pytest.mark.parametrize("kind", ["follows_motion", "in_steps", "in_valleys"])
def test_it_goes_to_better_sizes_for_as_long_as_there_are_any(looked, kind):
    found = look_beside(
        _fit(8.7, kind),
        SimpleNamespace(residual=lambda signals: signals),
        SimpleNamespace(exact=None, cheap=None),
    )
    assert found.values[1] == pytest.approx(TRUE, abs=0.05)
    assert len(looked) == 3 * (24 if kind == "in_steps" else 6)  # what jumps is looked for nearer, and further away


def test_it_stays_where_no_size_is_better(looked):
    fit = _fit(8.001)
    assert (
        look_beside(fit, SimpleNamespace(residual=lambda signals: signals), SimpleNamespace(exact=None, cheap=None))
        is fit
    )
    assert len(looked) == 6


def test_effects_that_change_smoothly_cost_nothing(looked):
    fit = _fit(8.7, "none of these")
    assert look_beside(fit, SimpleNamespace(), SimpleNamespace()) is fit
    assert looked == []


@pytest.mark.parametrize("better", [True, False])
def test_in_the_end_all_effects_are_looked_beside(monkeypatch, better):
    """What was found later may have moved an earlier one's size: the last step then leaves what that leaves."""
    fit, after = SimpleNamespace(problem=SimpleNamespace(effects=["one", "two"])), SimpleNamespace()
    places = []

    def beside(fit, target, simulators, place):
        places.append(place)
        return after if better and place == 1 else fit

    monkeypatch.setattr(search, "look_beside", beside)
    study = SimpleNamespace(target=None, simulators=None, error=lambda held: held, heldout=lambda _: 1.1)
    steps = [Step(("one",), (), (), 3.0, 2.0), Step(("two",), (), (), 2.0, 1.5), Step((), (), (), 1.5, 1.5)]
    left, found = search._look_beside_all(study, steps, fit)
    assert places == [0, 1]
    assert found is (after if better else fit)
    assert [step.error_after for step in left] == ([2.0, 1.1, 1.1] if better else [2.0, 1.5, 1.5])
