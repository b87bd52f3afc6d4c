"""ForceError: Δf_i = f_goal − f_i."""

from __future__ import annotations

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tensordict import TensorDict
from torchrl.envs import TransformedEnv, check_env_specs

from forcegrasp.transforms import ForceError

NEWTONS = st.floats(-5, 10, width=32)


@settings(max_examples=50, deadline=None)
@given(goal=arrays(np.float32, (4, 1), elements=NEWTONS), force=arrays(np.float32, (4, 2), elements=NEWTONS))
def test_equals_the_equation(goal: np.ndarray, force: np.ndarray) -> None:
    frame = TensorDict({"goal_force": torch.from_numpy(goal), "sensed_force": torch.from_numpy(force)}, batch_size=[4])
    error = ForceError()(frame)["force_error"].numpy()
    want = np.array([[float(goal[row, 0]) - float(force[row, i]) for i in range(2)] for row in range(4)])
    np.testing.assert_allclose(error, want, rtol=1e-6, atol=1e-6)


def test_sign_is_positive_below_the_goal() -> None:
    frame = TensorDict({"goal_force": torch.tensor([0.5]), "sensed_force": torch.tensor([0.25, 0.75])})
    assert ForceError()(frame)["force_error"].tolist() == [0.25, -0.25]


def test_at_reset_and_each_step(fake_grasp, play, actions) -> None:
    env = TransformedEnv(fake_grasp(), ForceError(force_key="force"))
    rollout = play(env, actions(9, 3, size=0.003))
    for frames in (rollout, rollout.get("next")):
        want = frames["goal_force"].double().numpy() - frames["force"].double().numpy()
        np.testing.assert_allclose(frames["force_error"], want, atol=1e-6)
    assert rollout["force"].any()


def test_error_may_leave_the_bounds_of_the_force(fake_grasp) -> None:
    base = fake_grasp(bounded=True, forces=torch.full((9, 3, 2), 5.0))
    check_env_specs(TransformedEnv(base, ForceError(force_key="force")))
