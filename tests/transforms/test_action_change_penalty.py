"""ActionChangePenalty: r_act = −Σ_i |a_i(t−1) − a_i(t)| of the clipped actions; reward + α₃ r_act."""

from __future__ import annotations

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from torchrl.envs import TransformedEnv, check_env_specs
from torchrl.envs.transforms import Compose

from forcegrasp.transforms import ActionChangePenalty, ActionScale, LastAction

ROWS = 3
ACTIONS = arrays(
    np.float32, (12, ROWS, 2), elements=st.one_of(st.sampled_from([-1.0, 1.0]), st.floats(-9, 9, width=32))
)
TERM = ("reward_terms", "action")


def make_env(fake_grasp, weight: float, **base) -> TransformedEnv:
    return TransformedEnv(
        fake_grasp((ROWS,), **base), Compose(LastAction(), ActionChangePenalty(weight), ActionScale(0.003))
    )


@settings(max_examples=20, deadline=None)
@given(given_actions=ACTIONS, weight=st.sampled_from([0.0, 0.2, 1.0, 7.0]))
def test_equals_the_equation_in_every_episode(fake_grasp, play, given_actions: np.ndarray, weight: float) -> None:
    rollout = play(make_env(fake_grasp, weight), torch.from_numpy(given_actions))
    done = rollout["next", "done"].squeeze(-1).numpy()
    assert done.any()
    for row in range(ROWS):
        left = right = 0.0
        for t, (a_left, a_right) in enumerate(np.clip(given_actions[:, row].astype(np.float64), -1, 1)):
            term = -(abs(left - a_left) + abs(right - a_right))
            np.testing.assert_allclose(rollout["next", *TERM][row, t], [term], atol=1e-6)
            own = rollout["next", "force"][row, t].double().sum().item()  # the base env's reward
            np.testing.assert_allclose(rollout["next", "reward"][row, t], [own + weight * term], rtol=1e-5, atol=1e-5)
            left, right = (0.0, 0.0) if done[row, t] else (a_left, a_right)


def test_worst_change_is_four_and_no_change_costs_nothing(fake_grasp, play) -> None:
    given_actions = torch.tensor([-5.0, 1.0, 1.0, 2.0]).reshape(4, 1, 1).expand(4, ROWS, 2)
    rollout = play(make_env(fake_grasp, 1.0, steps=50), given_actions)
    # 1.0 and 2.0 are the same action to the environment, so going from one to the other is no change
    np.testing.assert_array_equal(rollout["next", *TERM][0, :, 0], [-2.0, -4.0, 0.0, 0.0])


def test_term_is_zero_at_reset_and_reward_is_not_invented(fake_grasp) -> None:
    state = make_env(fake_grasp, 1.0).reset()
    assert state[TERM].shape == (ROWS, 1)
    assert not state[TERM].any()
    assert "reward" not in state.keys()  # noqa: SIM118 (iterating a tensordict gives rows)


def test_reward_may_leave_its_bounds(fake_grasp) -> None:
    check_env_specs(make_env(fake_grasp, 100.0, bounded=True))
