"""Table 2 of the paper as a function of the frames."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.config import CurriculumConfig, GraspConfig, RewardConfig
from forcegrasp.curriculum import CurriculumValues, LinearSchedule

FRAMES = 3_000_000
START = CurriculumValues(0.0, 2e-4, 0.0, (0.020, 0.025), (0.0, 0.0))
FINAL = CurriculumValues(1.0, 5e-5, 0.0, (0.015, 0.035), (-0.040, 0.040))


def schedule(frames: int = FRAMES, **options) -> LinearSchedule:
    return LinearSchedule(CurriculumConfig(**options), GraspConfig(), RewardConfig(), frames)


def test_ends_are_the_papers_to_the_bit():
    values = schedule()
    assert values(0) == START
    assert values(FRAMES // 3) == FINAL
    assert values(FRAMES) == values(10 * FRAMES) == FINAL


def test_half_way():
    middle = schedule()(FRAMES // 6)
    assert middle.object_weight == pytest.approx(0.5)
    assert middle.speed_threshold_m == pytest.approx(1.25e-4)
    assert middle.radius_m == pytest.approx((0.0175, 0.030))
    assert middle.offset_m == pytest.approx((-0.020, 0.020))


def test_linear_in_the_frames():
    values = schedule(end_fraction=0.5)
    frames = np.linspace(0, FRAMES // 2, 7)
    curves = np.array([list(values(int(f)).scalars().values()) for f in frames])
    share = frames[:, None] / (FRAMES / 2)
    start, final = (np.array(list(v.scalars().values())) for v in (START, FINAL))
    np.testing.assert_allclose(curves, start + share * (final - start), atol=1e-12)


def test_scalars_name_every_value():
    assert FINAL.scalars() == {
        "object_weight": 1.0,
        "speed_threshold_m": 5e-5,
        "overshoot_weight": 0.0,
        "radius_low_m": 0.015,
        "radius_high_m": 0.035,
        "offset_low_m": -0.040,
        "offset_high_m": 0.040,
    }


@pytest.mark.parametrize("options", [{"enabled": False}, {"end_fraction": 0.0}])
def test_without_a_curriculum_the_final_values_hold_at_once(options):
    assert schedule(**options)(0) == FINAL


def test_final_values_are_those_of_grasp_and_reward():
    grasp = GraspConfig(radius_m=[0.02, 0.03], offset_m=[-0.01, 0.02])
    reward = RewardConfig(object_weight=0.3, speed_threshold_m=1e-4, overshoot_weight=0.8)
    final = LinearSchedule(CurriculumConfig(), grasp, reward, 300)(100)
    assert final == CurriculumValues(0.3, 1e-4, 0.8, (0.02, 0.03), (-0.01, 0.02))


def test_the_weight_of_the_overshoot_is_annealed_as_that_of_the_object():
    """Own form: 0.2 at the start, 0.8 at the end, linearly between."""
    curriculum, reward = CurriculumConfig(overshoot_weight=0.2), RewardConfig(overshoot_weight=0.8)
    values = LinearSchedule(curriculum, GraspConfig(), reward, FRAMES)
    found = [values(frames).overshoot_weight for frames in (0, FRAMES // 6, FRAMES // 3, FRAMES)]
    assert found == pytest.approx([0.2, 0.5, 0.8, 0.8])


#: One other value for every option of the curriculum.
OTHER = {
    "enabled": False,
    "end_fraction": 0.7,
    "object_weight": 0.1,
    "speed_threshold_m": 3e-4,
    "overshoot_weight": 0.5,
    "radius_m": [0.021, 0.025],
    "offset_m": [0.0, 0.001],
}


@pytest.mark.parametrize("option", [field.name for field in dataclasses.fields(CurriculumConfig)])
def test_every_option_changes_the_schedule(option):
    assert schedule(**{option: OTHER[option]})(FRAMES // 10) != schedule()(FRAMES // 10)
