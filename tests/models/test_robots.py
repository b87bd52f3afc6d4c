"""Robots of the prior: always the same by number, within their ranges, and each of their parts counts."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.config import PhysicsConfig
from forcegrasp.effects import catalogue
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.env import build_env
from forcegrasp.errors import ConfigError
from forcegrasp.models.model_file import read_model, write_model
from forcegrasp.models.object_body import ObjectBody
from forcegrasp.models.robot_prior import EFFECTS
from forcegrasp.models.robots import DrawnRobots, FixedRobots, Robots, draw_robots, population, robot_model
from forcegrasp.models.variation import ModelVariation
from forcegrasp.physics import GraspSimulator, default_gripper, load_gripper, shipped_grippers

ROWS = np.arange(6)


def forces(
    robots: DrawnRobots | FixedRobots | ModelVariation, n: int = 6, ids: np.ndarray = ROWS, steps: int = 40
) -> np.ndarray:
    """Readings of a grasp that closes for a while, ``(steps, n, channels)``."""
    simulator = GraspSimulator(n, "fast", 1, robots, default_gripper())
    simulator.reset(simulator.parameters[ids], ids, np.random.default_rng(5))
    found = []
    for _ in range(steps):
        simulator.step(np.full((n, 2), -0.002))
        found.append(np.concatenate([simulator.measured_force, simulator.measured_position], axis=1))
    return np.array(found)


def plain(**changes) -> Robots:
    """Six robots with no effect, of which some things are changed."""
    drawn = draw_robots(default_gripper(), np.random.default_rng(0), 6)
    nulls = [EffectSetting(e.effect, e.variant, np.repeat(e.effect.null_values()[None], 6, 0)) for e in drawn.effects]
    return dataclasses.replace(drawn, effects=tuple(nulls), **changes)


def test_a_number_is_always_the_same_robot():
    few, many = population(default_gripper(), 3), population(default_gripper(), 5)
    for robot in range(3):
        assert dict(few.sizes(robot)) == dict(many.sizes(robot))
    assert dict(few.sizes(0)) != dict(few.sizes(1))
    assert many[np.array([4])].base["position_gain"] == many.base["position_gain"][4]


def test_a_robots_model_is_the_robot(tmp_path):
    gripper, number = default_gripper(), 7
    written = robot_model(gripper, number)
    write_model(written, tmp_path / "robot.yaml")
    read = read_model(tmp_path / "robot.yaml")
    robots = population(gripper, number + 1)[np.array([number])]
    known = [e for e in robots.effects if (e.values != e.effect.null_values()).any()]
    for found, drawn in zip(read.effects, known, strict=True):
        assert found.variant == drawn.variant
        np.testing.assert_allclose(found.values, drawn.values[0], rtol=1e-6)
    same = np.array([0])
    one, other = (forces(v, 1, same) for v in (FixedRobots(robots), ModelVariation(read)))
    np.testing.assert_allclose(one, other, atol=1e-6)


def test_every_effect_of_a_robot_has_a_prior():
    robots = {n for n, e in catalogue().items() if not (e.of_set or e.servo_only)}
    left_out = {
        "smooth_friction", "smooth_load_friction", "smooth_stiction", "smooth_object_friction", "finger_creep",
        "smooth_force_limit", "rate_limited_lag", "contact_friction", "hunt_crossley_contact", "encoder_scale",
        "return_spring", "contact_damping", "contact_onset", "object_mass", "table_friction", "friction_asymmetry",
        "backlash_asymmetry", "compliance_asymmetry", "two_mass_backlash", "motor_asymmetry",
        "rounded_force_hysteresis", "viscous_friction", "object_pull", "second_order_lag", "delay_asymmetry",
        "deadzone_asymmetry",
    }  # fmt: skip
    assert set(EFFECTS) == (robots - left_out) | {ObjectBody.name}
    assert all(0 < p.chance <= 1 and 0 < p.low <= p.high and p.why for p in EFFECTS.values())


def test_contacts_of_robots_only_stiffen():
    robots = draw_robots(load_gripper("tiago"), np.random.default_rng(1), 500)
    extra = next(e for e in robots.effects if e.effect.name == "stiffening_contact").values[:, 0]
    assert extra.min() == 0 < extra.max()


@pytest.mark.parametrize("name", shipped_grippers())
def test_robots_of_any_gripper_are_within_bounds_and_have_effects_as_often_as_they_should(name):
    robots = draw_robots(load_gripper(name), np.random.default_rng(1), 2000)
    for setting in robots.effects:
        prior = EFFECTS[setting.effect.name]
        present = (setting.values != setting.effect.null_values()).any(axis=1)
        for p, values in zip(setting.effect.parameters, setting.values.T, strict=True):
            assert ((p.low <= values[present]) & (values[present] <= p.high)).all()
            fixed = prior.fixed.get(p.name)
            assert fixed is None or (values[present] == fixed).all()
        share = prior.chance / len(prior.variants_of(setting.effect))
        assert setting.variant in prior.variants_of(setting.effect)
        assert present.mean() == pytest.approx(share, abs=0.04)
    for parameter, values in robots.base.items():
        assert values.std() > 0
        assert load_gripper(name).parameters[parameter].low <= values.min()
    simulator = GraspSimulator(4, "fast", 1, DrawnRobots(load_gripper(name)), load_gripper(name))
    for _ in range(8):
        simulator.step(np.full_like(simulator.joint_position, -simulator.gripper.max_step))
    assert len(np.unique(simulator.measured_position[:, 0])) == 4


def test_a_robot_drawn_for_a_row_acts_as_the_same_one_given():
    """Also where other rows have effects that it has not, and whichever rows are reset."""
    drawn = forces(DrawnRobots(default_gripper()))
    given = FixedRobots(draw_robots(default_gripper(), np.random.default_rng(5), 6))
    np.testing.assert_array_equal(drawn, forces(given))
    assert len(np.unique(drawn[-1], axis=0)) == 6
    some = np.array([1, 4])
    again = forces(DrawnRobots(default_gripper()), ids=some)[:, some]
    pair = FixedRobots(draw_robots(default_gripper(), np.random.default_rng(5), 2))
    np.testing.assert_array_equal(again, forces(pair, 2, np.arange(2)))


def test_robots_drawn_anew_leave_the_others_as_they_were():
    """Rows that are not reset go on as if nothing had happened, whatever the new ones have."""
    some, others = np.array([1, 4]), np.array([0, 2, 3, 5])

    def go_on(anew: bool) -> np.ndarray:
        simulator = GraspSimulator(6, "fast", 1, DrawnRobots(default_gripper()), default_gripper())
        simulator.reset(simulator.parameters, None, np.random.default_rng(8))
        found = []
        for step in range(50):
            if anew and step in (10, 25):
                simulator.reset(simulator.parameters[some], some, np.random.default_rng(step))
            simulator.step(np.full((6, 2), -0.002))
            found.append(np.concatenate([simulator.measured_force, simulator.measured_position], axis=1))
        return np.array(found)

    disturbed, plain = go_on(True), go_on(False)
    np.testing.assert_array_equal(disturbed[:, others], plain[:, others])
    assert (disturbed[11:, some] != plain[11:, some]).any(axis=(0, 2)).all()


@pytest.mark.parametrize("parameter", range(2))
def test_mass_and_friction_of_the_object_count(parameter):
    robots = plain()
    one = robots.effects[-1] if robots.effects[-1].effect is ObjectBody else None
    assert one
    before = forces(FixedRobots(robots))
    one.values[:, parameter] = 0.5
    assert (before != forces(FixedRobots(robots))).any()
    plant = GraspSimulator(6, "fast", 1, FixedRobots(robots), default_gripper()).plant
    for name in (("body_mass", "body_inertia"), ("geom_friction",))[parameter]:
        there = plant.base(name) > 0
        assert np.isin(plant.field(name)[there] / plant.base(name)[there], [0.5, 1.0]).all()
        assert (plant.field(name)[there] < plant.base(name)[there]).any()


def test_noise_and_rounding_are_those_of_each_robot():
    robots = plain(noise=np.array([[1, 0.0]] * 3 + [[0, 2.0]] * 3))
    rounding = next(e for e in robots.effects if e.effect.after_noise)
    rounding.values[-1] = 0.001, 0.5
    env = build_env(6, physics=PhysicsConfig(tier="fast", threads=1), robots=FixedRobots(robots))
    after = env.rollout(30).get("next")
    position = (after["sensed_position"] - after["measured_position"]).numpy()
    force = (after["sensed_force"] - after["measured_force"]).numpy()
    np.testing.assert_allclose(position[:3].std((1, 2)), 2.7e-5, rtol=0.4)
    np.testing.assert_allclose(force[3:5].std((1, 2)), 2 * 0.013, rtol=0.4)
    assert not force[:3].any()
    assert not position[3:5].any()
    steps = after["sensed_force"][-1].numpy() / 0.5
    np.testing.assert_allclose(steps, steps.round(), atol=1e-6)
    env.close()


def test_a_model_and_robots_are_one_too_many():
    with pytest.raises(ConfigError, match="robots: a model is given, too; leave one of them out"):
        build_env(2, model="virtual_robot", robots=DrawnRobots(default_gripper()))
