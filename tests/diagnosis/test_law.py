"""A law for what no effect of the catalogue explains: found where there is one, and none on noise."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.diagnosis.law.law_terms import LIBRARY, along, likely_periods, terms
from forcegrasp.effects.law import make_law
from forcegrasp.errors import ConfigError
from forcegrasp.identify.verdict import Verdict
from forcegrasp.models.model_file import Fitted, FoundEffect, read_model, write_model
from forcegrasp.models.variation import ModelVariation
from forcegrasp.physics.plant import Plant
from forcegrasp.reports.law import law_json, law_section, law_words
from tests.light_set import light_set


def silent(text: str) -> None:
    """Takes what a search tells about its progress."""


@pytest.fixture(scope="module")
def bent():
    """The diagnosis of a set whose force sensors read more and more as the force grows."""
    loaded = light_set(seed=15, grasps=6, sensor=lambda force: force + 0.4 * force * abs(force))
    return diagnose_set(loaded, None, ["force_bias"], 0, silent, law=True)[0]


def test_the_right_term_is_found(bent):
    law = bent.law
    assert bent.verdict is Verdict.UNKNOWN
    assert (law.law.formula_of.place, law.law.formula_of.expression) == ("force", "c1 * force * abs(force)")
    assert law.parameters["c1"].low < 0.4 < law.parameters["c1"].high
    assert law.parameters["c1"].value == pytest.approx(0.4, rel=0.15)
    assert law.error_after < 1.1 * bent.floor < law.error_before
    assert law.share > 0.8


@pytest.mark.long
def test_a_curve_whose_turning_point_is_on_the_way_is_found():
    """A cable that pulls at a sensor, most where the gripper is half open: with a line or a square much was left."""
    loaded = light_set(seed=15, grasps=6)
    pulled = [
        dataclasses.replace(g, force_n=g.force_n + 120 * g.position_m * (g.position_m - 0.045))
        for g in loaded.measured.grasps
    ]
    loaded = dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=tuple(pulled)))
    found, _ = diagnose_set(loaded, None, ["force_saturation"], 0, silent, law=True)
    law = found.law
    assert law is not None
    assert (law.law.formula_of.place, law.law.formula_of.expression) == (
        "force",
        "c1 * position * (position - centre1)",
    )
    assert law.parameters["c1"].value == pytest.approx(120, rel=0.2)
    assert law.parameters["centre1"].value == pytest.approx(0.045, abs=2e-3)
    assert law.error_after < 1.1 * found.floor < law.error_before


def test_it_is_told_in_words_and_as_data(bent):
    told = law_json(bent.law)
    assert told is not None
    assert told["equation"].startswith("f' = f + 0.39")
    assert told["equation"] in law_words(bent.law)
    section = law_section(bent.law, bent.target)
    assert "law.yaml" in str(section.blocks[-1])
    added = along(bent.law.law, None, bent.fit, bent.target)
    force = bent.fit.predicted[..., 2:]
    inside = bent.target.mask
    size = bent.law.law.formula_of.parameters["c1"].value
    np.testing.assert_allclose(added[inside], (size * force * abs(force))[inside], rtol=1e-9)


def test_every_term_does_something_and_is_small(made_up):
    fit, target = made_up.base.fit, made_up.target
    library = list(terms(fit, target))
    assert len(library) > 0.9 * sum(map(len, LIBRARY.values()))
    assert len({law.name for law in library}) == len(library)
    for law in library:
        added = np.abs(along(law, None, fit, target)[target.mask])
        if law.formula_of.place == "force":
            assert 0 < np.quantile(added, 0.98) < 5 * target.sigma[2]


@pytest.mark.parametrize("period_m", [0.002, 0.005, 0.013])
def test_the_period_of_what_is_left_along_the_way_is_tried(made_up, period_m):
    fit, target = made_up.base.fit, made_up.target
    position, rng = fit.predicted[..., :2], np.random.default_rng(0)
    wave = 2 * np.sin(2 * np.pi * position / period_m + [0.4, 1.6]) + 300 * position**2
    residual = fit.residual.copy()
    residual[..., :2] = np.where(target.mask[..., None], wave + rng.standard_normal(wave.shape), np.nan)
    first, *_ = likely_periods(dataclasses.replace(fit, residual=residual), target)
    way = np.ptp(position[target.mask])
    assert 1 / first == pytest.approx(1 / period_m, abs=0.2 / way)  # a fit finds the rest


def test_waves_of_two_fingers_may_be_apart(made_up):
    waves = [law for law in terms(made_up.base.fit, made_up.target) if "period" in law.formula_of.expression]
    assert {law.formula_of.place for law in waves} == {"motor", "position"}
    assert all("apart * side" in law.formula_of.expression for law in waves)


def test_a_model_file_holds_a_law_that_can_be_trained_with(made_up, tmp_path):
    formula = next(iter(terms(made_up.base.fit, made_up.target))).formula_of
    law = make_law("mine", formula, made_up.loaded.gripper)
    size = formula.parameters["c1"].value
    found = FoundEffect(law, "", {"c1": Fitted(size, 0.9 * size, 1.1 * size, law.parameters[0].unit)})
    write_model(dataclasses.replace(made_up.model, effects=(found,)), tmp_path / "model.yaml")
    (again,) = read_model(tmp_path / "model.yaml").effects
    assert (again.effect.name, again.effect.formula, again.parameters) == ("mine", law.formula, found.parameters)
    model = read_model(tmp_path / "model.yaml")
    plant = Plant(model.gripper, 2, "fast", threads=1)
    variation = ModelVariation(model)
    variation.attach(plant)
    variation.draw(np.random.default_rng(0), np.arange(2))
    plant.reset(np.arange(2), np.zeros(2))
    plant.advance(np.full((2, 2), 0.03), 5)
    assert 0.9 * size < plant.motor_push[0, 0] < 1.1 * size
    text = (tmp_path / "model.yaml").read_text()
    (tmp_path / "model.yaml").write_text(text.replace("expression: c1", "expression: c1 * open(position)"))
    with pytest.raises(ConfigError, match=r"effects.mine.law.expression: open: no such function"):
        read_model(tmp_path / "model.yaml")
