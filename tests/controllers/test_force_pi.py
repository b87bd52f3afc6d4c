"""The hand-written controller, against the same law in scalar float64."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from tensordict import TensorDict
from torchrl.envs.utils import check_env_specs

from forcegrasp.config import GraspConfig, PhysicsConfig
from forcegrasp.controllers import ForcePI
from forcegrasp.env import build_env

NEAR = GraspConfig(radius_m=[0.03, 0.035], offset_m=[-0.006, 0.006], steps=50)


def scalar_law(touched, errors, integral, kp=0.18, ki=1.13, stiffness=160.0, closing_step=0.004, max_delta=0.003):
    """Actions of both fingers and the new integral, for one grasp and one step."""
    if touched[0] and touched[1]:
        delta = 0.0
        for error in errors:
            error = error / stiffness
            integral += error * 0.04
            delta += kp * error + ki * integral
        deltas = [-delta / 2, -delta / 2]
    else:
        deltas = [0.0 if t else -closing_step for t in touched]
    return [min(1.0, max(-1.0, d / max_delta)) for d in deltas], integral


@pytest.mark.parametrize(
    "gains",
    [
        {},
        {"kp": 0.9, "ki": 0.0},
        {"kp": 0.0, "ki": 4.0},
        {"stiffness": 50.0},
        {"closing_step": 0.001},
        {"max_delta": 0.01},
    ],
    ids=lambda gains: "-".join(gains) or "default",
)
def test_law(gains):
    n, steps = 40, 30
    rng = np.random.default_rng(0)
    touched = rng.random((n, 1, 2)) * steps < np.arange(steps)[None, :, None]
    error = rng.normal(0.1, 0.6, (n, steps, 2)).astype(np.float32)
    controller = ForcePI(**gains)
    integral, expected_integral = torch.zeros(n, 1), np.zeros(n)
    clipped = 0
    for t in range(steps):
        td = TensorDict(
            {
                "had_contact": torch.from_numpy(touched[:, t]).float(),
                "force_error": torch.from_numpy(error[:, t]),
                "force_integral": integral,
            },
            batch_size=n,
        )
        action = controller(td)["action"]
        integral = td["next", "force_integral"]
        expected = np.zeros((n, 2))
        for i in range(n):
            expected[i], expected_integral[i] = scalar_law(
                touched[i, t], error[i, t].astype(float), expected_integral[i], **gains
            )
        np.testing.assert_allclose(action, expected, atol=2e-6)
        np.testing.assert_allclose(integral[:, 0], expected_integral, atol=1e-8)
        clipped += (np.abs(expected) == 1).sum()
    assert touched.all(axis=-1).mean() > 0.2
    assert np.abs(expected_integral).max() > 1e-4
    assert clipped > 0 or "closing_step" in gains or "max_delta" in gains


def test_phases():
    td = TensorDict(
        {
            "had_contact": torch.tensor([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]),
            "force_error": torch.full((4, 2), 0.2),
            "force_integral": torch.full((4, 1), 1e-4),
        },
        batch_size=4,
    )
    action = ForcePI()(td)["action"]
    assert action[:3].tolist() == [[-1, -1], [0, -1], [-1, 0]]  # closes; the finger that has touched waits
    assert action[3, 0] == action[3, 1]  # both share one delta
    assert -1 < action[3, 0] < 0  # too little force: squeezes
    carried = td["next", "force_integral"][:, 0]
    assert (carried[:3] == torch.tensor(1e-4)).all()  # the integral runs with both in contact only
    assert carried[3] == pytest.approx(1e-4 + 2 * 0.2 / 160 * 0.04)


def test_works_on_any_batch_shape():
    state = {
        "had_contact": torch.ones(3, 2, 2),
        "force_error": torch.rand(3, 2, 2),
        "force_integral": torch.zeros(3, 2, 1),
    }
    nested = ForcePI()(TensorDict(state, batch_size=(3, 2)))
    flat = ForcePI()(TensorDict(state, batch_size=(3, 2)).reshape(6))
    torch.testing.assert_close(nested["action"].reshape(6, 2), flat["action"])


@pytest.fixture
def env():
    env = build_env(4, physics=PhysicsConfig("fast", 1), grasp=NEAR)
    return env.append_transform(ForcePI().make_tensordict_primer())


def test_specs_with_the_integral(env):
    check_env_specs(env, seed=0)


def test_integral_is_carried_by_the_environment(env):
    rollout = env.rollout(50, ForcePI())
    before, after = rollout["force_integral"], rollout["next", "force_integral"]
    assert not before[:, 0].any()
    assert torch.equal(before[:, 1:], after[:, :-1])
    both = rollout["had_contact"].bool().all(-1)
    assert both.any(1).all()
    error = (rollout["force_error"].double().sum(-1) / 160 * 0.04 * both).cumsum(1)
    np.testing.assert_allclose(after[..., 0], error, atol=1e-7)
    for i in range(4):  # and it is what the action was computed from
        for step in rollout[i]:
            expected, _ = scalar_law(
                step["had_contact"].bool().tolist(), step["force_error"].tolist(), step["force_integral"].item()
            )
            np.testing.assert_allclose(step["action"], expected, atol=1e-5)


def test_integral_starts_anew_with_the_grasp(env):
    state = env.rollout(50, ForcePI(), break_when_any_done=False)["next"][:, -1].exclude("reward")
    assert (state["force_integral"] != 0).all()
    mask = torch.tensor([[True], [False], [False], [True]])
    reset = env.reset(state.clone().set("_reset", mask))
    assert torch.equal(reset["force_integral"], torch.where(mask, 0.0, state["force_integral"]))


def test_integral_starts_anew_within_a_rollout(env):
    rollout = env.rollout(60, ForcePI(), break_when_any_done=False)
    assert (rollout["force_integral"][:, 49] != 0).all()
    assert not rollout["force_integral"][:, 50].any()


def test_force_settles_at_the_goal():
    grasp = GraspConfig(kappa=[0.0, 0.5], steps=150)
    env = build_env(16, physics=PhysicsConfig("fast", 1), grasp=grasp, seed=1)
    env = env.append_transform(ForcePI().make_tensordict_primer())
    after = env.rollout(150, ForcePI())["next"]
    error = (after["goal_force"] - after["force"])[:, -25:].mean((1, 2)).abs()
    assert (error < 0.1 * after["goal_force"][:, -1, 0]).float().mean() > 0.9
