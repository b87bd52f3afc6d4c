"""Training gets better at what it is rewarded for, on problems that take seconds."""

from __future__ import annotations

import numpy as np


def test_actions_grow_calm_where_calm_is_all_that_counts(tiny, trained, metrics, tmp_path):
    config = tiny(
        grasp={"steps": 10},
        reward={"force_weight": 0.0, "object_weight": 0.0, "action_weight": 1.0},
        curriculum={"enabled": False},
        # 15 updates: the first two batches are of the policy that has learned nothing
        ppo={"grasps": 64, "total_frames": 64 * 10 * 16, "learning_rate": 0.02, "epochs": 8, "minibatch": 320},
    )
    rows = metrics(trained(tmp_path / "run", config))
    assert rows[-1]["episode/action_change"] < 0.5 * rows[0]["episode/action_change"]
    assert rows[-1]["ppo/action_std"] < 0.6 * rows[0]["ppo/action_std"]


def test_force_comes_closer_to_its_goal(tiny, trained, metrics, tmp_path):
    one_object = {"kappa": [0.5, 0.5], "b2": [-9.0, -9.0], "radius_m": [0.03, 0.03], "offset_m": [0.0, 0.0]}
    config = tiny(
        grasp=one_object | {"steps": 30, "goal_force_min_n": 0.3, "goal_force_max": 0.4},
        reward={"form": "goal_normalised", "object_weight": 0.0, "action_weight": 0.0},
        curriculum={"enabled": False},
        ppo={"grasps": 64, "total_frames": 64 * 30 * 14, "learning_rate": 0.01, "epochs": 8, "minibatch": 480},
    )
    rows = metrics(trained(tmp_path / "run", config))
    first, last = (np.mean([row["episode/force_reward_normalised"] for row in part]) for part in (rows[:2], rows[-2:]))
    assert last > 1.4 * first
    errors = [row["ppo/loss_critic"] for row in rows]
    assert np.median(errors[1:]) < 0.3 * errors[0]
