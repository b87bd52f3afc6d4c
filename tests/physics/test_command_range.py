"""Servos take commands within the range of their actuators; what happens to a command after that may leave it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import forcegrasp
from forcegrasp.effects import get_effect
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant


def stands(gripper: str, command: float, *effects: tuple[str, list[float], str]) -> float:
    """Where a motor comes to rest, over all effects on the same row and without any object near, in its own units."""
    plant = Plant(load_gripper(gripper), 1, threads=1)
    row = np.array([0])
    plant.attach([(get_effect(name)(np.array([values]), plant.dt, variant), row) for name, values, variant in effects])
    plant.reset(row, np.zeros(1), np.full((1, plant.motors), load_gripper(gripper).motors[0].stroke))
    for _ in range(1500):
        plant.advance(np.full((1, plant.motors), command))
    return float(plant.position[0, 0])


@pytest.mark.parametrize("beyond", [0.05, 0.5])
def test_a_command_beyond_the_range_is_its_end(beyond):
    """With effects on commands, as without."""
    assert stands("tiago", beyond) == stands("tiago", 0.045)
    delayed = ("command_delay", [0.01], "")
    assert stands("tiago", beyond, delayed) == pytest.approx(stands("tiago", 0.045), abs=1e-9)


def test_a_servo_whose_encoder_is_off_presses_against_the_end_stop():
    """Told to stand at the open end, it pushes on for as long as its encoder says that it is not there."""
    pressed = stands("tiago", 0.045, ("encoder_bias", [-0.002, -0.002], "loop"))
    assert pressed - stands("tiago", 0.045) > 30e-6  # by 0.2 N


def test_a_range_in_the_actuators_own_units_is_kept(tmp_path):
    """The Robotiq's grows while closing: one that must not go below 0.2 opens to 0.6 rad, and no further."""
    assets = Path(forcegrasp.__file__).parent / "assets"
    scene = (assets / "robotiq_2f85.xml").read_text("utf-8")
    assert scene.count('ctrlrange="0 0.8"') == 1
    (tmp_path / "robotiq_2f85.xml").write_text(scene.replace('ctrlrange="0 0.8"', 'ctrlrange="0.2 0.8"'), "utf-8")
    described = (assets / "robotiq_2f85.yaml").read_text("utf-8").replace("open: 0.0", "open: 0.2")
    (tmp_path / "narrow.yaml").write_text(described, "utf-8")
    narrow = str(tmp_path / "narrow.yaml")
    assert stands(narrow, 0.75, ("command_delay", [0.01], "")) == pytest.approx(stands(narrow, 0.6), abs=1e-4)
    assert stands(narrow, 0.75) == pytest.approx(stands(narrow, 0.6), abs=1e-4)
