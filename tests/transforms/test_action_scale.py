"""ActionScale: u = clip(a, −1, 1) · Δq_max."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tensordict import TensorDict
from torchrl.envs import TransformedEnv

from forcegrasp.transforms import ActionScale

ACTIONS = arrays(
    np.float32, (5, 2), elements=st.one_of(st.sampled_from([-1.0, 0.0, 1.0]), st.floats(-1e6, 1e6, width=32))
)


@settings(max_examples=100, deadline=None)
@given(action=ACTIONS, max_delta=st.floats(1e-5, 0.045))
def test_equals_the_equation(action: np.ndarray, max_delta: float) -> None:
    frame = TensorDict({"action": torch.from_numpy(action)}, batch_size=[5])
    out = ActionScale(max_delta).inv(frame)
    want = np.array([[max(-1.0, min(1.0, float(a))) * max_delta for a in row] for row in action])
    np.testing.assert_allclose(out["joint_delta"], want, rtol=1e-6, atol=1e-12)
    np.testing.assert_array_equal(out["action"], action)
    assert "joint_delta" not in frame.keys()  # noqa: SIM118 (iterating a tensordict gives rows)


def test_env_receives_the_delta_and_the_policys_action_is_stored(fake_grasp, play) -> None:
    given_actions = torch.tensor([[-7.0, 0.5]]).expand(3, 3, 2)
    rollout = play(TransformedEnv(fake_grasp(), ActionScale(0.003)), given_actions)
    np.testing.assert_allclose(rollout["next", "received"][1, 2], [-0.003, 0.0015], rtol=1e-6)
    np.testing.assert_array_equal(rollout["action"], given_actions)
    assert "joint_delta" not in rollout.keys()  # noqa: SIM118 (iterating a tensordict gives rows)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_policy_sees_the_unit_box_instead_of_metres(fake_grasp, dtype: torch.dtype) -> None:
    env = TransformedEnv(fake_grasp(dtype=dtype), ActionScale(0.003))
    assert env.action_keys == ["action"]
    assert env.action_spec.shape == (3, 2)
    assert env.action_spec.dtype == dtype
    assert (env.action_spec.low == -1).all()
    assert (env.action_spec.high == 1).all()
    assert env.base_env.action_keys == ["joint_delta"]
