"""Grippers drawn from a fitted model: within its intervals, anew for each episode, and none where nothing was found."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from forcegrasp.effects import catalogue, get_effect
from forcegrasp.errors import ConfigError
from forcegrasp.models.model_file import Fitted, FoundEffect, Model, write_model
from forcegrasp.models.variation import ModelVariation, read_model_of
from forcegrasp.physics import GraspParameters, GraspSimulator
from forcegrasp.physics.gripper_file import default_gripper, load_gripper
from forcegrasp.physics.plant import Plant

TIAGO = load_gripper("tiago")
NOMINAL = {
    n: Fitted(p.nominal, p.nominal, p.nominal, p.unit) for n, p in TIAGO.parameters.items() if p.scope == "gripper"
}
BASE = {"position_gain": Fitted(90.0, 80.0, 95.0, "N/m"), "velocity_gain": Fitted(-8.0, -9.0, -6.0, "N·s/m")}
DELAY = {"delay_s": Fitted(0.06, 0.02, 0.1, "s")}
BIAS = {"left_n": Fitted(0.02, 0.0, 0.03, "N"), "right_n": Fitted(-0.01, -0.02, -0.01, "N")}


def model_of(base: dict[str, Fitted], *effects: tuple[str, dict[str, Fitted]]) -> Model:
    return Model(
        TIAGO, base, effects=tuple(FoundEffect(get_effect(n), get_effect(n).variants[0], p) for n, p in effects)
    )


FITTED = model_of(BASE, ("command_delay", DELAY), ("force_bias", BIAS))


def attached(model: Model, n: int) -> tuple[ModelVariation, Plant]:
    plant, variation = Plant(TIAGO, n, "fast", threads=1), ModelVariation(model)
    variation.attach(plant)
    return variation, plant


def values_of(plant: Plant) -> np.ndarray:
    """Parameters of all effects in a plant, ``(n, parameters)``."""
    return np.concatenate([effect.values for effect in plant.effects], axis=1)


def grasps(n: int) -> GraspParameters:
    return GraspParameters(*np.repeat([[0.3], [-9.0], [0.033], [0.001], [0.2]], n, axis=1))


def squeeze(simulator: GraspSimulator, steps: int = 40, start: int = 0) -> np.ndarray:
    """Closes, holds with small steps, opens; what is read and what happened, ``(steps, n, 8)``."""
    seen = []
    for step in range(start, steps):
        delta = -0.003 if step < 20 else 0.002 if step > 34 else -0.0008 + 6e-4 * np.sin(step)
        simulator.step(np.full((simulator.n, 2), delta))
        seen.append(
            np.concatenate(
                [simulator.measured_position, simulator.measured_force, simulator.joint_position, simulator.force],
                axis=1,
            )
        )
    return np.array(seen)


def simulate(n: int, model: Model | None = None, seed: int = 0) -> GraspSimulator:
    simulator = GraspSimulator(n, "fast", 1, None if model is None else ModelVariation(model))
    simulator.reset(grasps(n), rng=np.random.default_rng(seed))
    return simulator


def test_draws_fill_the_intervals():
    variation, plant = attached(FITTED, 2000)
    base = variation.draw(np.random.default_rng(0), np.arange(2000))
    assert {*base} == {*BASE}
    drawn = [*base.values(), *values_of(plant).T]
    for values, fitted in zip(drawn, [*BASE.values(), *DELAY.values(), *BIAS.values()], strict=True):
        assert values.shape == (2000,)
        assert fitted.low <= values.min() <= fitted.low + 0.01 * (fitted.high - fitted.low)
        assert fitted.high >= values.max() >= fitted.high - 0.01 * (fitted.high - fitted.low)
        assert values.mean() == pytest.approx((fitted.low + fitted.high) / 2, abs=0.03 * (fitted.high - fitted.low))
    assert np.abs(np.corrcoef(drawn) - np.eye(5)).max() < 0.1  # each on its own


def test_draws_are_seeded_and_differ():
    drawn = []
    for seed in (1, 1, 2):
        variation, plant = attached(FITTED, 4)
        rng = np.random.default_rng(seed)
        for _ in range(2):
            base = variation.draw(rng, np.arange(4))
            drawn.append(np.concatenate([np.stack([*base.values()], axis=1), values_of(plant)], axis=1))
    first, second, again, again_second, other, _ = drawn
    assert np.array_equal(first, again)
    assert np.array_equal(second, again_second)
    assert not (first == second).any()
    assert not (first == other).any()
    assert all(len(np.unique(column)) == 4 for column in first.T)


def test_partial_draws_leave_the_other_rows():
    variation, plant = attached(FITTED, 5)
    rng, which = np.random.default_rng(0), np.array([1, 4])
    variation.draw(rng, np.arange(5))
    before = values_of(plant).copy()
    base = variation.draw(rng, which)
    assert all(len(values) == 2 for values in base.values())
    changed = (values_of(plant) != before).all(axis=1)
    assert np.flatnonzero(changed).tolist() == which.tolist()
    assert np.array_equal(values_of(plant)[~changed], before[~changed])


def test_numbers_without_an_interval_take_nothing_from_the_generator():
    certain = {name: Fitted(f.value, f.value, f.value, f.unit) for name, f in BIAS.items()}
    variation, plant = attached(model_of(NOMINAL, ("force_bias", certain)), 3)
    rng = np.random.default_rng(5)
    base = variation.draw(rng, np.arange(3))
    assert rng.bit_generator.state == np.random.default_rng(5).bit_generator.state
    assert {name: set(values) for name, values in base.items()} == {name: {f.value} for name, f in NOMINAL.items()}
    assert np.array_equal(values_of(plant), [[0.02, -0.01]] * 3)


@functools.cache
def bare(n: int) -> np.ndarray:
    return squeeze(simulate(n))


def test_the_grasp_is_worth_looking_at():
    force = bare(2)[:, :, 6:]
    assert (force.max(axis=0) > 0.7).all()
    assert (force[-1] == 0).all()


def test_a_model_of_nothing_changes_no_bit():
    """Nominal base parameters and all effects at their null values."""
    absent = [
        (e.name, {p.name: Fitted(p.null, p.null, p.null, p.unit) for p in e.parameters}) for e in catalogue().values()
    ]
    assert squeeze(simulate(2, model_of(NOMINAL))).tobytes() == bare(2).tobytes()
    assert squeeze(simulate(2, model_of(NOMINAL, *absent))).tobytes() == bare(2).tobytes()


@pytest.mark.parametrize("name", [name for name, effect in catalogue().items() if not effect.after_noise])
def test_every_effect_varies_from_episode_to_episode(name):
    """Rows with the same grasp differ, for the effect differs; and so do two episodes of a row.

    But for a converter's rounding, which comes after the noise: see tests of the environment.
    """
    kind = get_effect(name)
    sizes = {p.name: (*sorted((p.typical, 0.5 * p.typical)), p.unit) for p in kind.parameters}
    model = model_of(NOMINAL, (name, {key: Fitted(low, low, high, unit) for key, (low, high, unit) in sizes.items()}))
    simulator, rows = simulate(4, model), np.arange(4)
    first = squeeze(simulator)
    simulator.reset(grasps(4), rng=np.random.default_rng(9))
    second = squeeze(simulator)
    assert np.isfinite(first).all()
    assert any(first[:, 0].tobytes() != first[:, row].tobytes() for row in rows)
    assert any(first[:, row].tobytes() != second[:, row].tobytes() for row in rows)


def test_partial_resets_leave_the_other_grasps_alone():
    whole = squeeze(simulate(3, FITTED))
    simulator = simulate(3, FITTED)
    squeeze(simulator, steps=20)
    simulator.reset(grasps(2), np.array([0, 2]), np.random.default_rng(7))
    after = squeeze(simulator, start=20)
    assert after[:, 1].tobytes() == whole[20:, 1].tobytes()
    assert after[:, 0].tobytes() != whole[20:, 0].tobytes()


def test_base_parameters_that_are_drawn_are_written():
    simulator = simulate(4, model_of(BASE))
    gain = simulator.plant.field("actuator_gainprm")[:, simulator.plant.actuators, 0]
    damping = simulator.plant.field("actuator_biasprm")[:, simulator.plant.actuators, 2]
    assert np.all((gain >= 80) & (gain <= 95))
    assert np.array_equal(gain[:, 0], gain[:, 1])
    assert len(np.unique(gain)) == 4
    assert np.array_equal(damping[:, 0], simulator.parameters.b2)  # what the learner is told is what was drawn
    assert np.all((damping >= -9) & (damping <= -6))


def test_delays_that_are_drawn_anew_act():
    """The line is long enough for the longest, and each row starts to move after its own delay."""
    rows = 6
    simulator = simulate(rows, model_of(NOMINAL, ("command_delay", {"delay_s": Fitted(0.0, 0.0, 0.2, "s")})))
    (effect,) = simulator.plant.effects
    for seed in range(3):
        simulator.reset(grasps(rows), rng=np.random.default_rng(seed))
        moved = np.full(rows, np.nan)
        for step in range(120):
            simulator.plant.advance(np.full((rows, 2), 0.03))
            at_once = np.isnan(moved) & (simulator.joint_position[:, 0] < 0.045 - 1e-9)
            moved[at_once] = step * simulator.plant.dt
        # a delay between two steps mixes them: it starts with the shorter one
        expected = np.floor(effect.values[:, 0] / simulator.plant.dt) * simulator.plant.dt
        assert moved == pytest.approx(expected, abs=1e-9)
        assert np.ptp(moved) > 0.05


def test_only_models_of_tiago_are_for_learning(root, tmp_path):
    second = load_gripper(str(root / "tests" / "grippers" / "second.yaml"))
    base = {n: Fitted(p.nominal, p.low, p.high, p.unit) for n, p in second.parameters.items() if p.scope == "gripper"}
    write_model(Model(second, base), tmp_path / "second.yaml")
    with pytest.raises(ConfigError, match=r"second\.yaml: is of gripper second, and .*; say gripper=\S*second\.yaml"):
        read_model_of(default_gripper(), tmp_path / "second.yaml")
    write_model(FITTED, tmp_path / "tiago.yaml")
    assert read_model_of(default_gripper(), str(tmp_path / "tiago.yaml")) == FITTED
