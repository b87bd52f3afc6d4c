"""Where the paper gives a value, it is the default; typed in from Lach et al. (2023): Sec. 3 and 4, eq. 7, Table 2."""

from __future__ import annotations

import pytest

from forcegrasp.config import TrainConfig
from forcegrasp.physics import default_gripper
from forcegrasp.physics.completion import complete

TRAINING = complete(TrainConfig(), default_gripper())


def test_what_is_drawn_for_a_grasp():
    grasp = TRAINING.grasp
    assert (grasp.kappa, grasp.b2) == ([0.0, 1.0], [-13.0, -6.0])
    assert (grasp.radius_m, grasp.offset_m) == ([0.015, 0.035], [-0.04, 0.04])


def test_sensors_and_actions():
    config = TRAINING
    assert (config.sensors.position_std_m, config.sensors.force_std_n) == (2.7e-5, 0.013)
    assert config.action.max_delta_m == 0.003
    assert (config.action.bias_one_contact, config.action.bias_floor) == (0.1, 0.9)
    assert (config.observation.frames, len(config.observation.parts)) == (3, 5)


def test_curriculum():
    config = TRAINING
    start, end = config.curriculum, config.reward
    assert start.end_fraction == pytest.approx(1 / 3)  # the authors' code; the paper does not say
    assert (start.object_weight, end.object_weight) == (0.0, 1.0)
    assert (start.speed_threshold_m, end.speed_threshold_m) == (2e-4, 5e-5)
    assert (start.radius_m, start.offset_m) == ([0.020, 0.025], [0.0, 0.0])
