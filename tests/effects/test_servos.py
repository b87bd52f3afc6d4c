"""Every effect of servos on every shipped mechanism: nothing at its null value, something at its typical size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from forcegrasp.effects import Effect, catalogue
from forcegrasp.effects.for_gripper import effect_of, effects_of, why_left_out
from forcegrasp.errors import ConfigError
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant

MECHANISMS = ("so101_jaw", "emps", "xl330_pendulum", "bam_pendulum", "dfki_pendulum")
#: Waves and steps, and a rest: shares of the span, or of an effort that moves it so far.
TIME_S = np.arange(0, 1.9, 0.02)
WAVES = 0.6 * np.sin(2.1 * TIME_S) + 0.1 * np.sin(7 * TIME_S) + 0.08 * ((TIME_S // 0.9) % 2)
PATH = np.concatenate([WAVES, np.full(16, WAVES[-1])])


def play(plant: Plant) -> np.ndarray:
    """Positions and efforts that are read after each command, ``(samples, n, readings)``."""
    gripper, seen = plant.gripper, []
    plant.reset(np.arange(plant.n), np.zeros(plant.n))
    size = gripper.motors[0].stroke if gripper.command == "position" else 4.0
    for command in size * PATH:
        plant.advance(np.full((plant.n, 1), command), round(0.02 / plant.dt))
        seen.append(np.concatenate([plant.measured_position, plant.measured_force], axis=1))
    assert not plant.warnings().any()
    return np.array(seen)


@pytest.mark.parametrize("name", MECHANISMS)
def test_null_values_change_no_bit_and_typical_sizes_what_is_read(name):
    mechanism = load_gripper(name)
    cases = [(e, v) for e in effects_of(mechanism).values() if not e.after_noise for v in e.variants]
    plant = Plant(mechanism, 1 + 2 * len(cases), threads=1)
    plant.attach(
        [
            (e(np.array([e.null_values(), e.typical_values()]), plant.dt, v), np.array([1, 2]) + 2 * i)
            for i, (e, v) in enumerate(cases)
        ]
    )
    seen = play(plant)
    changed = np.abs(seen - seen[:, :1]).max(axis=0) / np.ptp(seen[:, 0], axis=0)
    assert [c for c, row in zip(cases, changed[1::2], strict=True) if row.any()] == []
    assert [c for c, row in zip(cases, changed[2::2], strict=True) if not row.any()] == []


def test_what_needs_a_position_loop_or_pads_is_left_out():
    jaw, pendulum, gripper = (load_gripper(name) for name in ("so101_jaw", "dfki_pendulum", "tiago"))
    assert effect_of("backlash", jaw).variants == ("command",)
    assert effect_of("encoder_bias", jaw).variants == ("reading", "loop")
    assert effect_of("encoder_bias", pendulum).variants == ("reading",)
    assert "elastic_transmission" not in effects_of(gripper)
    for name in ("position_deadband", "back_emf", "command_deadband", "rate_limit", "backlash", "velocity_lag"):
        assert name in effects_of(jaw)
        with pytest.raises(ConfigError, match=f"effect {name}: needs .*positions that are commanded"):
            effect_of(name, pendulum)
    for mechanism in (jaw, pendulum, gripper):
        known = effects_of(mechanism)
        assert all(bool(why_left_out(e, mechanism)) == (e.name not in known) for e in catalogue().values())


def test_a_late_velocity_needs_a_servo_that_acts_on_it(tmp_path):
    jaw = load_gripper("so101_jaw")
    scene = jaw.model.read_text()
    assert 'kv="0.6"' in scene
    (tmp_path / "so101_jaw.xml").write_text(scene.replace('kv="0.6"', ""))
    described = jaw.path.read_text()
    for text, known in ((described, True), (described.replace("-actuator_biasprm 2", "dof_damping"), False)):
        (tmp_path / "jaw.yaml").write_text(text)
        assert ("velocity_lag" in effects_of(load_gripper(str(tmp_path / "jaw.yaml")))) == known
    with pytest.raises(ConfigError, match=r"velocity_lag: needs servos that act on their velocity; .* have no `kv`"):
        effect_of("velocity_lag", load_gripper(str(tmp_path / "jaw.yaml")))


@pytest.mark.parametrize(
    ("old", "new", "known"),
    [("", "", False), ("dof_damping", "dof_armature", True), ("dof_damping", "-actuator_biasprm 2", True)],
)
def test_damping_is_an_effect_where_no_base_parameter_has_it(tmp_path, old, new, known):
    """Nor the servo's gain on the velocity, unless its effort is read."""
    gripper = load_gripper("so101_gripper")
    (tmp_path / "so101_gripper.xml").write_text(gripper.model.read_text())
    (tmp_path / "mine.yaml").write_text(gripper.path.read_text().replace(old, new))
    assert gripper.force == "motor"
    assert ("viscous_friction" in effects_of(load_gripper(str(tmp_path / "mine.yaml")))) == known
    assert "viscous_friction" not in effects_of(load_gripper("tiago"))


def test_a_branch_goes_with_the_stiffness_of_objects_that_have_one():
    second = load_gripper(str(Path(__file__).parents[1] / "grippers" / "second.yaml"))
    assert "solid_by_object" in effect_of("viscoelastic_contact", second).variants
    assert effect_of("viscoelastic_contact", load_gripper("tiago")).variants == ("recovering", "following", "solid")


@pytest.mark.parametrize(
    ("effect", "names", "units"),
    [
        ("motor_offset", ["offset_nm"], ["N·m"]),
        ("stiction", ["breakaway_nm", "kinetic_share", "stribeck_rad_s"], ["N·m", "1", "rad/s"]),
        ("presliding", ["torque_nm", "displacement_rad"], ["N·m", "rad"]),
        ("smooth_friction", ["torque_nm", "creep_rad_s"], ["N·m", "rad/s"]),
        ("direction_friction", ["excess_nms_rad"], ["N·m·s/rad"]),
        ("back_emf", ["stall_nm", "no_load_rad_s"], ["N·m", "rad/s"]),
        ("position_deadband", ["band_rad"], ["rad"]),
    ],
)
def test_parameters_of_a_motor_that_turns(effect: str, names: list[str], units: list[str]):
    kind: type[Effect] = effect_of(effect, load_gripper("so101_jaw"))
    assert [p.name for p in kind.parameters] == names
    assert [p.unit for p in kind.parameters] == units
    assert kind.trials().shape[1] == len(names)


def test_damping_is_scaled_as_effort_over_speed():
    (parameter,), (nominal,) = (
        effect_of("direction_friction", load_gripper(name)).parameters for name in ("emps", "tiago")
    )
    assert parameter.typical == pytest.approx(nominal.typical * 100 / 5)  # 100 times the force, 5 times as far
