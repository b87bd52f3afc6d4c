"""The grasps that policies are compared on: objects are read strictly and grasped as in the paper's Table 1."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.config import GraspConfig
from forcegrasp.errors import ForcegraspError
from forcegrasp.evaluate.grids import object_grid, read_objects
from forcegrasp.physics import default_gripper
from forcegrasp.physics.sampling import offset_limits_m

TIAGO = default_gripper()

GOOD = "format: forcegrasp-objects/1\nobjects:\n  cup: {diameter_m: 0.06, kappa: 0.3, goal_force_n: [0.2, 0.9]}\n"


def test_the_papers_objects_can_be_held_with_their_goal_forces():
    objects = read_objects("paper", GraspConfig())
    assert [thing.name for thing in objects] == ["rubber_mat", "sponge", "spray", "pringles", "wood", "mug"]
    grid = object_grid(objects, GraspConfig(), 50, seed=0)
    grasps = grid.grasps
    assert grid.trials == 50
    assert np.all(grasps.goal_force_n <= 0.9501 * TIAGO.training.max_force_n * TIAGO.training.force_scale(grasps.kappa))
    limit = offset_limits_m(TIAGO, grasps.radius_m, 0.012)[1]
    assert np.all(np.abs(grasps.offset_m) + grasps.radius_m < TIAGO.stroke)
    assert np.all((np.abs(grasps.offset_m) >= limit / 2) & (np.abs(grasps.offset_m) <= limit))
    assert 0.3 < np.mean(grasps.offset_m > 0) < 0.7


def test_other_seeds_draw_other_grasps():
    objects = read_objects("paper", GraspConfig())
    one, same, other = (object_grid(objects, GraspConfig(), 3, seed).grasps.as_array() for seed in (0, 0, 1))
    np.testing.assert_array_equal(one, same)
    assert (one != other).any()


def test_own_objects(tmp_path):
    path = tmp_path / "objects.yaml"
    path.write_text(GOOD)
    (cup,) = read_objects(str(path), GraspConfig())
    assert (cup.name, cup.diameter_m, cup.kappa, cup.goal_force_n) == ("cup", 0.06, 0.3, (0.2, 0.9))


BROKEN = {
    "other format": (GOOD.replace("objects/1", "objects/9"), "format: must be forcegrasp-objects/1"),
    "no objects": ("format: forcegrasp-objects/1\nobjects:\n", "objects: missing, such as `cup: {diameter_m: 0.06"),
    "no diameter": (GOOD.replace("diameter_m: 0.06, ", ""), "objects.cup.diameter_m: missing"),
    "unknown key": (GOOD.replace("kappa", "kapa"), "objects.cup.kapa: unknown; did you mean kappa"),
    "millimetres": (GOOD.replace("0.06", "60"), "diameter_m: must lie between 0.024 and 0.09"),
    "squeezed flat": (GOOD.replace("0.06", "0.02"), "diameter_m: must lie between"),
    "kappa": (GOOD.replace("0.3", "1.3"), "kappa: must lie between"),
    "text": (GOOD.replace("0.3", "soft"), "is not a number"),
    "one goal": (GOOD.replace("[0.2, 0.9]", "0.9"), "must be \\[low, high\\]"),
    "goals swapped": (GOOD.replace("[0.2, 0.9]", "[0.9, 0.2]"), "0.9 > 0.2"),
    "negative goal": (GOOD.replace("[0.2, 0.9]", "[-0.2, 0.9]"), "goal_force_n: must lie between 0 and 50"),
    "not a mapping": (
        GOOD.replace("{diameter_m: 0.06, kappa: 0.3, goal_force_n: [0.2, 0.9]}", "7"),
        "cup: must map",
    ),
    "not YAML": ("format: [", "not YAML"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_objects_are_refused_in_one_line(name, tmp_path):
    text, message = BROKEN[name]
    path = tmp_path / "objects.yaml"
    path.write_text(text)
    with pytest.raises(ForcegraspError, match=message) as refusal:
        read_objects(str(path), GraspConfig())
    assert "objects.yaml" in str(refusal.value)
    assert "\n" not in str(refusal.value)
    with pytest.raises(ForcegraspError, match="not readable"):
        read_objects(str(tmp_path / "nowhere.yaml"), GraspConfig())
