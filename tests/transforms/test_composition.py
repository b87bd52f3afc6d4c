"""All transforms as build_env stacks them, against the paper's equations written out once more for one grasp."""

from __future__ import annotations

from unittest import mock

import numpy as np
import pytest
import torch
from tensordict import TensorDictBase
from tensordict.nn import AddStateIndependentNormalScale, TensorDictModule
from torch import nn
from torchrl.envs import EnvBase
from torchrl.envs.utils import ExplorationType, set_exploration_type
from torchrl.modules import IndependentNormal, ProbabilisticActor

from forcegrasp.config import ActionConfig, ObservationConfig, RewardConfig, SensorConfig
from forcegrasp.env import build, build_env

ROWS, STEPS = 8, 40
MAX_DELTA, THRESHOLD, WEIGHT = 0.002, 0.02, 0.7  # noise alone passes this threshold now and then
ONE, FLOOR = 0.3, 0.8
PARTS = ("position", "force", "force_error", "last_action", "had_contact")


def stack_on(base: EnvBase, parts=PARTS, frames: int = 3, inductive_bias: bool = True) -> EnvBase:
    with mock.patch.object(build, "GraspEnv", return_value=base):
        return build_env(
            ROWS,
            sensors=SensorConfig(force_std_n=0.013, contact_threshold_n=THRESHOLD),
            observation=ObservationConfig(list(parts), frames),
            action=ActionConfig(MAX_DELTA, inductive_bias, ONE, FLOOR),
            reward=RewardConfig(action_weight=WEIGHT),
        )


def double(frame: TensorDictBase, key) -> np.ndarray:
    return frame.get(key).double().numpy()


def observe(frame: TensorDictBase, h: np.ndarray, last: np.ndarray) -> dict[str, np.ndarray]:
    """o(t) by part, from the readings of one grasp and its memory."""
    force = double(frame, "sensed_force")
    return {
        "position": double(frame, "sensed_position") / 0.045 * 2 - 1,
        "force": force,
        "force_error": double(frame, "goal_force") - force,
        "last_action": last,
        "had_contact": h,
    }


def bias(h: np.ndarray, error: np.ndarray, goal: float) -> np.ndarray:
    if h.sum() == 2:
        return np.maximum(FLOOR, 1 - np.abs(error) / goal)
    return np.where(h == 1, ONE, 1.0) if h.sum() == 1 else np.ones(2)


@pytest.mark.parametrize("inductive_bias", [True, False])
@pytest.mark.parametrize(("parts", "frames"), [(PARTS, 3), (("had_contact", "position"), 1), (("last_action",), 5)])
def test_every_grasp_follows_the_equations(
    fake_grasp, play, actions, parts: tuple, frames: int, inductive_bias: bool
) -> None:
    given = actions(STEPS, ROWS) - 0.5
    rollout = play(stack_on(fake_grasp((ROWS,), steps=12), parts, frames, inductive_bias), given)
    phases = set()
    for row in range(ROWS):
        stack: list[dict] = []
        for t in range(STEPS):
            now, after = rollout[row, t], rollout.get("next")[row, t]
            if not stack:
                h, last = np.zeros(2), np.zeros(2)
                stack = frames * [observe(now, h, last)]
            stacked = np.concatenate([seen[part] for seen in stack for part in parts])
            np.testing.assert_allclose(now["observation"], stacked, atol=2e-6)

            action = double(now, "action")
            np.testing.assert_array_equal(action, given[t, row])
            phi = bias(h, stack[-1]["force_error"], float(now["goal_force"])) if inductive_bias else 1.0
            phases.add(h.sum())
            clipped = np.clip(action, -1, 1)
            np.testing.assert_allclose(after["received"], phi * clipped * MAX_DELTA, rtol=1e-4, atol=1e-9)

            term = -np.abs(last - clipped).sum()
            np.testing.assert_allclose(after["reward_terms", "action"], [term], atol=1e-6)
            np.testing.assert_allclose(after["reward"], [double(after, "force").sum() + WEIGHT * term], atol=1e-5)

            h, last = np.maximum(h, double(after, "sensed_force") > THRESHOLD), clipped
            stack = [*stack[1:], observe(after, h, last)]
            stacked = np.concatenate([seen[part] for seen in stack for part in parts])
            np.testing.assert_allclose(after["observation"], stacked, atol=2e-6)
            if after["done"]:
                stack = []
    assert phases == {0, 1, 2}, "every phase of a grasp is meant to occur"


def test_stored_actions_keep_their_log_probability(fake_grasp) -> None:
    torch.manual_seed(0)
    net = nn.Sequential(nn.Linear(30, 2), AddStateIndependentNormalScale(2))
    policy = ProbabilisticActor(
        TensorDictModule(net, in_keys=["observation"], out_keys=["loc", "scale"]),
        in_keys=["loc", "scale"],
        distribution_class=IndependentNormal,
        return_log_prob=True,
    )
    env = stack_on(fake_grasp((ROWS,), steps=12))
    with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
        rollout = env.rollout(30, policy, break_when_any_done=False)
        again = policy.log_prob(rollout.select("observation", "action"))
    assert (rollout["action"].abs() > 1).any(), "some actions are meant to be clipped on their way to the base env"
    ratio = rollout["next", "received"] / (rollout["action"].clamp(-1, 1) * MAX_DELTA)
    assert (ratio < 0.99).any(), "some actions are meant to be biased on their way to the base env"
    torch.testing.assert_close(again, rollout["action_log_prob"])
    loc, scale, action = (double(rollout, key) for key in ("loc", "scale", "action"))
    want = (-0.5 * ((action - loc) / scale) ** 2 - np.log(scale * np.sqrt(2 * np.pi))).sum(-1)
    np.testing.assert_allclose(rollout["action_log_prob"], want, rtol=1e-4, atol=1e-5)
