"""LastAction: o(t) holds clip(a(t−1), −1, 1), and 0 at the start of an episode."""

from __future__ import annotations

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from torchrl.data import Unbounded
from torchrl.envs import TransformedEnv, check_env_specs
from torchrl.envs.transforms import Compose

from forcegrasp.transforms import ActionScale, LastAction

ROWS = 3
ACTIONS = arrays(
    np.float32, (12, ROWS, 2), elements=st.one_of(st.sampled_from([-1.0, 1.0]), st.floats(-9, 9, width=32))
)


@settings(max_examples=20, deadline=None)
@given(given_actions=ACTIONS)
def test_equals_the_equation_in_every_episode(fake_grasp, play, given_actions: np.ndarray) -> None:
    env = TransformedEnv(fake_grasp((ROWS,)), Compose(LastAction(), ActionScale(0.003)))
    rollout = play(env, torch.from_numpy(given_actions))
    done = rollout["next", "done"].squeeze(-1).numpy()
    assert done.any()
    for row in range(ROWS):
        last = np.zeros(2)
        for t, action in enumerate(given_actions[:, row].astype(np.float64)):
            np.testing.assert_array_equal(rollout["last_action"][row, t], last)
            last = np.minimum(np.maximum(action, -1.0), 1.0)
            np.testing.assert_array_equal(rollout["next", "last_action"][row, t], last)
            if done[row, t]:
                last = np.zeros(2)


def test_remembers_the_policys_action_not_the_command(fake_grasp, play) -> None:
    given_actions = torch.tensor([[[-0.5, 3.0]] * ROWS])
    rollout = play(TransformedEnv(fake_grasp(), Compose(LastAction(), ActionScale(0.003))), given_actions)
    np.testing.assert_array_equal(rollout["action"][0, 0], [-0.5, 3.0])
    np.testing.assert_array_equal(rollout["next", "last_action"][0, 0], [-0.5, 1.0])
    np.testing.assert_allclose(rollout["next", "received"][0, 0], [-0.0015, 0.003], rtol=1e-6)


def test_spec_is_the_unit_box(fake_grasp) -> None:
    spec = TransformedEnv(fake_grasp(), LastAction(action_key="joint_delta")).observation_spec["last_action"]
    assert spec.shape == (ROWS, 2)
    assert (spec.low == -1).all()
    assert (spec.high == 1).all()


def test_dtype_is_that_of_like(fake_grasp) -> None:
    class Mixed(fake_grasp):
        """Actions in float32, all else in float64."""

        def __init__(self) -> None:
            super().__init__(dtype=torch.float64)
            self.action_spec = Unbounded(shape=(ROWS, 2), dtype=torch.float32)

        def _step(self, tensordict):
            return super()._step(tensordict.set("joint_delta", tensordict.get("action").double()))

    check_env_specs(TransformedEnv(Mixed(), LastAction()))
