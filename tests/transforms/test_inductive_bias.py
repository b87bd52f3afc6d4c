"""InductiveBias: u_i = φ_i u_i, with φ of paper eq. 6."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tensordict import TensorDict
from torchrl.envs import TransformedEnv
from torchrl.envs.transforms import Compose

from forcegrasp.transforms import ActionScale, ForceError, HadContact, InductiveBias, contact_bias, gentle_closing

UNIT = st.floats(0, 1, width=32)
ROWS = 5
GRASPS = {
    "h": arrays(np.float32, (ROWS, 2), elements=st.sampled_from([0.0, 1.0])),
    "error": arrays(np.float32, (ROWS, 2), elements=st.one_of(st.just(0.0), st.floats(-10, 10, width=32))),
    "goal": arrays(np.float32, (ROWS, 1), elements=st.floats(0.0625, 5, width=32)),
}


def phi(h: np.ndarray, error: np.ndarray, goal: np.ndarray, one: float = 0.1, floor: float = 0.9) -> np.ndarray:
    out = np.empty(h.shape)
    for row in range(len(h)):
        for i, j in ((0, 1), (1, 0)):
            if h[row, i] == h[row, j] == 1:
                out[row, i] = max(floor, 1 - abs(float(error[row, i])) / float(goal[row, 0]))
            elif h[row, i] == 1 and h[row, i] != h[row, j]:
                out[row, i] = one
            else:
                out[row, i] = 1
    return out


def tensors(*values: np.ndarray) -> list[torch.Tensor]:
    return [torch.from_numpy(np.asarray(value, np.float32)) for value in values]


@settings(max_examples=100, deadline=None)
@given(**GRASPS, one=UNIT, floor=UNIT)
def test_phi_equals_the_equation(h, error, goal, one: float, floor: float) -> None:
    bias = contact_bias(*tensors(h, error, goal), one, floor, 2).numpy()
    np.testing.assert_allclose(bias, phi(h, error, goal, one, floor), rtol=1e-6, atol=1e-6)
    assert ((bias >= 0) & (bias <= 1)).all()


@pytest.mark.parametrize(
    ("h", "error", "want"),
    [
        ([0, 0], [0.5, 0.5], [1, 1]),
        ([1, 0], [0.1, 0.5], [0.1, 1]),
        ([0, 1], [0.5, 0.1], [1, 0.1]),
        ([1, 1], [0.0, 0.0], [1, 1]),
        ([1, 1], [0.025, -0.025], [0.95, 0.95]),
        ([1, 1], [0.05, 0.06], [0.9, 0.9]),
        ([1, 1], [-3.0, 0.0], [0.9, 1]),  # |Δf| > f_goal: the quotient alone would turn the action around
    ],
)
def test_phases_of_a_grasp(h: list, error: list, want: list) -> None:
    bias = contact_bias(*tensors([h], [error], [[0.5]]), 0.1, 0.9, 2)
    np.testing.assert_allclose(bias, [want], rtol=1e-6)


@pytest.mark.parametrize(
    ("h", "error", "want"),
    [
        ([0, 0], [0.5, 0.5], 1),
        ([1, 0], [0.0, 0.5], 1),  # between the touches it closes on
        ([0, 1], [0.5, 0.0], 1),
        ([1, 1], [0.02, -0.03], 0.95),  # of the mean error
        ([1, 1], [0.5, 0.5], 0.9),
        ([0], [0.5], 1),
        ([1], [0.02], 0.96),
        ([1], [0.5], 0.9),
    ],
)
def test_phases_of_a_grasp_with_one_motor(h: list, error: list, want: float) -> None:
    bias = contact_bias(*tensors([h], [error], [[0.5]]), 0.1, 0.9, 1)
    np.testing.assert_allclose(bias, [[want]], rtol=1e-6)


def test_two_motors_with_one_reading_move_alike() -> None:
    bias = contact_bias(*tensors([[1], [0]], [[0.02], [0.02]], [[0.5], [0.5]]), 0.1, 0.9, 2)
    np.testing.assert_allclose(bias, [[0.96, 0.96], [1, 1]], rtol=1e-6)


@pytest.mark.parametrize(
    ("h", "motors", "want"),
    [
        ([0, 0], 2, [0.5, 0.5]),  # gentle_closing has 1 there
        ([1, 0], 2, [0.1, 0.5]),
        ([0, 1], 2, [0.5, 0.1]),
        ([1, 1], 2, [1, 1]),
        ([0, 1], 1, [0.5]),
        ([0], 1, [0.5]),
    ],
)
def test_only_what_still_closes_does_so_slower(h: list, motors: int, want: list) -> None:
    bias = contact_bias(*tensors([h], [[0.0] * len(h)], [[0.05]]), 0.1, 0.9, motors, closing=torch.tensor([[0.5]]))
    np.testing.assert_allclose(bias, [want], rtol=1e-6)


@pytest.mark.parametrize(
    ("goal", "touch", "want"),
    [
        (0.05, 0.0, 1.0),  # nothing was touched
        (0.05, 0.02, 1.0),  # too soft to press beyond the goal
        (0.05, 0.04, 0.625**0.5),
        (0.05, 5.0, 0.5),  # up to a goal of 0.2 N alone
        (0.2, 5.0, 1.0),
        (1.5, 5.0, 1.0),
    ],
)
def test_closes_slower_on_hard_objects_where_little_is_asked_for(goal: float, touch: float, want: float) -> None:
    closing = gentle_closing(*tensors([[goal]], [[touch]]), gentle_n=0.2)
    np.testing.assert_allclose(closing, [[want]], rtol=1e-6)


def test_never_reverses_with_floor_zero() -> None:
    bias = contact_bias(*tensors([[1, 1]], [[9.0, -9.0]], [[0.5]]), 0.0, 0.0, 2)
    assert bias.tolist() == [[0.0, 0.0]]


def test_force_error_matters_only_with_both_in_contact() -> None:
    for h in ([0, 0], [1, 0], [0, 1]):
        near, far = (contact_bias(*tensors([h], [[e, -e]], [[0.5]]), 0.1, 0.5, 2) for e in (0.1, 0.2))
        assert torch.equal(near, far)
    near, far = (contact_bias(*tensors([[1, 1]], [[e, -e]], [[0.5]]), 0.1, 0.5, 2) for e in (0.1, 0.2))
    assert (near > far).all()


def test_double_precision_is_kept() -> None:
    h, error, goal = (value.double() for value in tensors([[1, 0]], [[0.5, 0.5]], [[0.5]]))
    np.testing.assert_allclose(contact_bias(h, error, goal, 0.1, 0.9, 2), [[0.1, 1.0]], rtol=1e-12)


@settings(max_examples=30, deadline=None)
@given(**GRASPS, delta=arrays(np.float32, (ROWS, 2), elements=st.floats(-0.045, 0.045).map(np.float32)))
def test_scales_the_delta_and_leaves_its_input_alone(h, error, goal, delta) -> None:
    keys = ("joint_delta", "had_contact", "force_error", "goal_force")
    frame = TensorDict(dict(zip(keys, tensors(delta, h, error, goal), strict=True)), batch_size=[ROWS])
    out = InductiveBias().inv(frame)
    want = delta.astype(np.float64) * phi(h, error, goal)
    np.testing.assert_allclose(out["joint_delta"], want, rtol=1e-6, atol=1e-9)
    np.testing.assert_array_equal(frame["joint_delta"], delta)


def test_env_gets_the_biased_command_of_the_state_the_policy_saw(fake_grasp, play, actions) -> None:
    transforms = HadContact(0.05, "force"), ForceError(force_key="force"), InductiveBias(), ActionScale(0.003)
    given_actions = actions(12, 20, size=1.5) - 0.8  # mostly closing
    rollout = play(TransformedEnv(fake_grasp((20,), steps=8), Compose(*transforms)), given_actions)
    seen = [
        rollout[key].reshape(-1, rollout[key].shape[-1]).numpy() for key in ("had_contact", "force_error", "goal_force")
    ]
    bias = phi(*seen)
    for value in (0.1, 0.9, 1.0):
        assert np.isclose(bias, value).any()
    assert ((bias > 0.901) & (bias < 0.999)).any()
    policy = given_actions.transpose(0, 1)
    want = np.clip(policy.double().numpy(), -1, 1).reshape(-1, 2) * 0.003 * bias
    np.testing.assert_allclose(rollout["next", "received"].reshape(-1, 2), want, rtol=1e-5)
    np.testing.assert_array_equal(rollout["action"], policy)
