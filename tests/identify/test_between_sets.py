"""Sets of one gripper whose truth is known: what differs is named, and nothing else."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from forcegrasp.effects import get_effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify import between_sets, fit_set
from forcegrasp.identify.between_sets import Agreement, BetweenSets, compare_sets
from forcegrasp.identify.intervals import intervals, standard_errors
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.noise_floor import numerical_error
from forcegrasp.identify.predict import predict
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.progress import silent
from forcegrasp.measure import MeasuredGrasp, MeasurementSet
from forcegrasp.models.model_file import Fitted, FoundEffect, Model
from forcegrasp.replay.replay import Replay
from tests.light_set import light_gripper

GRIPPER = light_gripper()
SIGMA = np.array([2.7e-5, 2.7e-5, 0.013, 0.013])
TRUTH = {"position_gain": 118.0, "velocity_gain": -7.4, "rho_m": 0.003, "force_scale": 2.0}
RADIUS = 0.022


def planned(name: str, thing: str, depth_m: float) -> MeasuredGrasp:
    """A short grasp that starts near the object: closes, holds, reverses, opens."""
    time = np.arange(45) * 0.04
    way = [
        RADIUS + 0.002,
        RADIUS - depth_m,
        RADIUS - depth_m,
        RADIUS - depth_m / 3,
        RADIUS - depth_m / 3,
        RADIUS + 0.003,
    ]
    command = np.interp(time, [0.12, 0.3 + 40 * depth_m, 0.9, 1.0, 1.3, 1.5], way)
    pair = np.repeat(command[:, None], 2, axis=1)
    return MeasuredGrasp(name, thing, "", RADIUS, 0.0, None, time, pair, pair, 0 * pair, None)


def measured(
    name: str, seed: int, things: str = "cup", play_m: float = 0.0, **changes: float
) -> Loaded[MeasurementSet]:
    """Eight grasps with noise, simulated by the model itself, whose parameters are TRUTH but for the changes."""
    bare = [planned(f"g{i}", things if i % 2 else "cup", 0.003 + 0.0004 * i) for i in range(8)]
    play = [EffectSetting(get_effect("backlash"), "play", np.array([play_m]))] if play_m else []
    problem = Problem(GRIPPER, bare, play)
    truth = TRUTH | changes | {"gap_m": play_m}
    case = problem.case(np.array([e.coordinate(truth[e.parameter]) for e in problem.entries]))
    signals = predict(Replay(GRIPPER, problem.grasps), [case])[0]
    signals = signals + SIGMA * np.random.default_rng(seed).standard_normal(signals.shape)
    full = tuple(
        dataclasses.replace(g, position_m=signals[i, :, :2], force_n=signals[i, :, 2:]) for i, g in enumerate(bare)
    )
    one = MeasurementSet(Path(name), name, "tiago", "", "", SIGMA[0], SIGMA[2], full, name)
    return Loaded(one, GRIPPER, [])


@pytest.fixture(scope="module")
def parts() -> list[Loaded[MeasurementSet]]:
    return [measured("a", 1), measured("b", 2, position_gain=124.0), measured("c", 3)]


@pytest.fixture(scope="module")
def three(parts) -> BetweenSets:
    return compare_sets(parts, Model(GRIPPER, {}), silent)


def without(found: BetweenSets, patch: pytest.MonkeyPatch, parts, left: int) -> BetweenSets:
    """The same of all sets but one, whose fits are known."""
    fits = {one.name: one for one in found.sets}
    patch.setattr(between_sets, "_fit", lambda part, model, progress: fits[part.measured.name])
    return compare_sets([one for k, one in enumerate(parts) if k != left], Model(GRIPPER, {}), silent)


def test_of_two_sets_the_gain_that_differs_is_named_and_nothing_else(three, parts, monkeypatch):
    found = without(three, monkeypatch, parts, left=2)
    (gain,) = found.of(Agreement.DIFFERS)
    assert gain.name == "position_gain"
    assert gain.is_ratio
    assert gain.differences["b"].low < 124 / 118 < gain.differences["b"].high
    assert gain.differences["b"].low > 1.02
    assert (gain.shared, gain.spread) == (None, None)
    assert {one.name for one in found.of(Agreement.SHARED)} == {"velocity_gain", "rho_m of cup", "force_scale of cup"}


def test_of_two_sets_that_are_alike_nothing_differs(three, parts, monkeypatch):
    found = without(three, monkeypatch, parts, left=1)
    assert [one.agreement for one in found.parameters] == [Agreement.SHARED] * 4
    for one in found.parameters:
        truth = TRUTH[one.name.split(" of ")[0]]
        assert one.shared is not None
        assert one.shared.low < truth < one.shared.high
        null = 1.0 if one.is_ratio else 0.0
        assert one.differences["c"].low < null < one.differences["c"].high
        assert one.p == pytest.approx(one.p_corrected) or one.p < one.p_corrected <= 1


def test_three_sets_have_a_spread_and_their_shared_value_includes_it(three):
    named = {one.name: one for one in three.parameters}
    gain, softness = named["position_gain"], named["rho_m of cup"]
    assert gain.agreement is Agreement.DIFFERS
    assert gain.spread is not None
    assert 0 < gain.spread.low < np.std(np.log([118, 124, 118]), ddof=1) < gain.spread.high
    assert gain.shared is not None
    assert gain.shared.low < 118 < 124 < gain.shared.high
    assert softness.agreement is Agreement.SHARED
    assert softness.spread is not None
    assert softness.spread.low == 0


def test_a_value_has_the_interval_that_a_fit_of_its_set_gives(three, parts):
    target, _, base = fit_set.apply_model(parts[0], Model(GRIPPER, {}), silent, refit=True)
    expected = intervals(base.fit, standard_errors(base.fit, target, numerical_error(base.fit, target)))
    for one, (value, low, high) in zip(three.parameters, expected, strict=False):
        assert one.values["a"] == Fitted(pytest.approx(value), pytest.approx(low), pytest.approx(high), one.unit)


def test_what_one_set_alone_has_is_not_compared(parts):
    found = compare_sets([parts[0], measured("d", 4, things="ball")], Model(GRIPPER, {}), silent)
    assert {one.name for one in found.parameters} == {
        "position_gain", "velocity_gain", "rho_m of cup", "force_scale of cup",
    }  # fmt: skip


@pytest.mark.long
def test_an_effect_of_the_model_is_compared_as_well(parts):
    play = FoundEffect(get_effect("backlash"), "play", {"gap_m": Fitted(5e-4, 4e-4, 6e-4, "m")})
    pair = [measured("e", 5, play_m=4e-4), measured("f", 6, play_m=8e-4)]
    found = compare_sets(pair, Model(GRIPPER, {}, effects=(play,)), silent)
    (gap,) = found.of(Agreement.DIFFERS)
    assert (gap.name, gap.unit) == ("backlash.gap_m", "m")
    assert gap.values["e"].low < 4e-4 < gap.values["e"].high
    assert gap.differences["f"].low < 4e-4 < gap.differences["f"].high


def test_a_fit_that_did_not_converge_tells_nothing(three, parts, monkeypatch):
    stuck = dataclasses.replace(three.sets[1].base, converged=False, reason="it still falls")
    sets = (three.sets[0], dataclasses.replace(three.sets[1], base=stuck))
    found = without(dataclasses.replace(three, sets=sets), monkeypatch, parts, left=2)
    assert {one.agreement for one in found.parameters} == {Agreement.UNCLEAR}
    assert {one.reason for one in found.parameters} == {"the fit of b did not converge"}
    assert all(one.shared is None and np.isnan(one.p) for one in found.parameters)


@pytest.mark.parametrize(
    ("change", "reason"),
    [("bound", "it ended at its bound in b"), ("loose", "b hardly fixes it"), ("no trace", "b hardly fixes it")],
)
def test_a_parameter_that_a_set_does_not_fix_is_not_told(three, parts, monkeypatch, change, reason):
    other = three.sets[1]
    fit, chance = other.base.fit, other.chance.copy()
    place = [e.name for e in fit.problem.entries].index("position_gain")
    if change == "bound":
        vector = fit.vector.copy()
        vector[place] = fit.problem.high[place]
        fit = dataclasses.replace(fit, vector=vector)
    else:
        chance[place] = 10.0 if change == "loose" else 0.0
    changed = dataclasses.replace(other, chance=chance, base=dataclasses.replace(other.base, fit=fit))
    found = without(dataclasses.replace(three, sets=(three.sets[0], changed)), monkeypatch, parts, left=2)
    (gain,) = found.of(Agreement.UNCLEAR)
    assert (gain.name, gain.reason) == ("position_gain", reason)
