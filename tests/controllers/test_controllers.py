"""The controllers by name, and those that others are held against."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from tensordict import TensorDict

from forcegrasp.config import ActionConfig, PhysicsConfig, SensorConfig
from forcegrasp.controllers import CONTROLLERS, Constant, ForcePI, InformedFeedForward, make_controller
from forcegrasp.env import build_env
from forcegrasp.errors import ConfigError
from forcegrasp.physics import FixedGrasps


@pytest.mark.parametrize(
    ("name", "kind"),
    [("force_pi", ForcePI), ("informed", InformedFeedForward), ("close", Constant), ("nothing", Constant)],
)
def test_names(name, kind):
    assert type(make_controller(name)) is kind


@pytest.mark.parametrize(("name", "value"), [("close", -1.0), ("nothing", 0.0)])
def test_constant(name, value):
    td = TensorDict({"joint_position": torch.rand(3, 2)}, batch_size=3)
    assert torch.equal(make_controller(name)(td)["action"], torch.full((3, 2), value))
    assert torch.equal(Constant(0.4)(td)["action"], torch.full((3, 2), 0.4))


def test_unknown_name_tells_the_closest():
    with pytest.raises(ConfigError, match=r"'force_p'.*did you mean force_pi"):
        make_controller("force_p")
    with pytest.raises(ConfigError, match="known: close, force_pi, informed, nothing"):
        make_controller("zzz")


def test_informed():
    """Closes, waits for the other finger, then a = −f_goal / (0.30 N · f_α)."""
    parameters = torch.tensor([[kappa, -9.0, 0.03, 0.0, 0.2] for kappa in (0.0, 0.5, 0.5, 0.5, 1.0, 1.0)])
    goal = torch.tensor([[0.6], [0.2], [0.2], [0.33], [0.1], [0.2]])
    had = torch.tensor([[1.0, 1.0], [0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [1.0, 1.0], [1.0, 1.0]])
    td = TensorDict({"had_contact": had, "goal_force": goal, "grasp_parameters": parameters}, batch_size=6)
    expected = [[-0.4, -0.4], [-1, -1], [0, -1], [-0.4, -0.4], [-0.1 / 0.15] * 2, [-1, -1]]
    np.testing.assert_allclose(InformedFeedForward()(td)["action"], expected, atol=1e-6)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_controllers_work_in_the_environment(name, draw):
    controller = make_controller(name)
    env = build_env(3, physics=PhysicsConfig("fast", 1))
    if hasattr(controller, "make_tensordict_primer"):
        env = env.append_transform(controller.make_tensordict_primer())
    action = env.rollout(15, controller)["action"]
    assert action.shape == (3, 15, 2)
    assert (action.abs() <= 1).all()
    assert all(key in env.rollout(2, controller).keys(True) for key in controller.out_keys)


def test_informed_is_a_static_feed_forward(draw):
    """No force enters, so that the command after the second touch is one and the same: it can't be an upper bound."""
    assert not [key for key in InformedFeedForward().in_keys if "force" in key and key != "goal_force"]
    env = build_env(
        4, physics=PhysicsConfig("fast", 1), sampler=FixedGrasps(draw(4)), sensors=SensorConfig(0.0, 0.0, 0.02)
    )
    rollout = env.rollout(80, InformedFeedForward())
    after = rollout["action"][:, -30:]
    assert rollout["had_contact"][:, -30:].all()
    assert torch.equal(after, after[:, :1].expand_as(after))
    assert (rollout["next", "force"][:, -30:].diff(dim=1).abs().amax() > 0).all()


def test_informed_reaches_the_goal(draw):
    grasps = draw(16, offset_m=[-0.004, 0.004])
    env = build_env(
        16,
        physics=PhysicsConfig("fast", 1),
        sampler=FixedGrasps(grasps),
        sensors=SensorConfig(0.0, 0.0, 0.02),
        action=ActionConfig(inductive_bias=False),
    )
    after = env.rollout(150, InformedFeedForward())["next"]
    np.testing.assert_allclose(after["force"][:, -25:].mean((1, 2)), grasps.goal_force_n, rtol=0.03)
