"""ObservationNoise: o = s + σ ε, ε ~ N(0, 1), a new one for every entry and step."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
import torch
from scipy import stats
from tensordict import TensorDict
from torchrl.envs import TransformedEnv, check_env_specs

from forcegrasp.transforms import ObservationNoise

KEYS = {"in_keys": ["joint_position", "force"], "out_keys": ["sensed_position", "sensed_force"]}
STDS = [2.7e-5, 0.013]


def make_frames(rows: int = 4) -> TensorDict:
    draws = torch.rand(rows, 4, generator=torch.Generator().manual_seed(0))
    return TensorDict({"joint_position": 0.045 * draws[:, :2], "force": 5 * draws[:, 2:]}, batch_size=[rows])


def epsilons(noise: ObservationNoise, frames: TensorDict) -> np.ndarray:
    """ε of every row, (rows, 4): positions', then forces'."""
    out = noise(frames.clone())
    pairs = zip(noise.in_keys, noise.out_keys, noise.std, strict=True)
    parts = [(out[after].double() - out[before].double()).numpy() / std for before, after, std in pairs]
    return np.concatenate(parts, -1)


def test_noise_is_standard_normal_and_independent() -> None:
    frames = make_frames(5000).double()
    noise = ObservationNoise(**KEYS, std=STDS, seed=1)
    steps = np.concatenate([epsilons(noise, frames), epsilons(noise, frames)], -1)  # (5000, 8)
    for column in steps.T:
        assert stats.kstest(column, "norm").pvalue > 1e-3
    correlation = np.corrcoef(steps.T) - np.eye(8)
    assert np.abs(correlation).max() < 5 / np.sqrt(5000)


def test_std_is_per_key_and_scales_the_noise() -> None:
    frames = make_frames().double()
    one, two = (ObservationNoise(**KEYS, std=std, seed=5)(frames.clone()) for std in (STDS, [2 * STDS[0], 3 * STDS[1]]))
    for before, after, factor in zip(KEYS["in_keys"], KEYS["out_keys"], (2, 3), strict=True):
        np.testing.assert_allclose(two[after] - frames[before], factor * (one[after] - frames[before]), rtol=1e-9)


def test_zero_std_copies_and_truth_stays() -> None:
    frames = make_frames()
    out = ObservationNoise(**KEYS, std=[0, 1.0])(frames.clone())
    assert torch.equal(out["sensed_position"], frames["joint_position"])
    assert not torch.equal(out["sensed_force"], frames["force"])
    assert torch.equal(out["force"], frames["force"])


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_dtype_is_kept(dtype: torch.dtype) -> None:
    assert ObservationNoise(**KEYS, std=STDS)(make_frames().to(dtype))["sensed_force"].dtype == dtype


def test_new_noise_at_reset_and_each_step(fake_grasp, play) -> None:
    env = TransformedEnv(fake_grasp(steps=50), ObservationNoise(**KEYS, std=STDS))
    rollout = play(env, torch.zeros(6, 3, 2))
    frames = [rollout[:, 0], *rollout.get("next").unbind(1)]
    noise = torch.stack([frame["sensed_force"] - frame["force"] for frame in frames])
    assert len(noise.unique()) == noise.numel() == 7 * 3 * 2


def test_same_seed_same_stream_and_set_seed_restarts() -> None:
    frames = make_frames()
    noise, same, other = (ObservationNoise(**KEYS, std=STDS, seed=seed) for seed in (4, 4, 5))
    first = epsilons(noise, frames)
    np.testing.assert_array_equal(first, epsilons(same, frames))
    assert not np.isclose(first, epsilons(other, frames)).any()
    assert not np.isclose(first, epsilons(noise, frames)).any()
    for restarted in (noise, other):
        restarted.set_seed(4)
        np.testing.assert_array_equal(first, epsilons(restarted, frames))


def test_global_generator_is_neither_read_nor_moved() -> None:
    frames = make_frames()
    torch.manual_seed(0)
    before, first = torch.get_rng_state(), epsilons(ObservationNoise(**KEYS, std=STDS), frames)
    assert torch.equal(before, torch.get_rng_state())
    torch.manual_seed(1)
    np.testing.assert_array_equal(first, epsilons(ObservationNoise(**KEYS, std=STDS), frames))


def through_state_dict(noise: ObservationNoise) -> ObservationNoise:
    other = ObservationNoise(**KEYS, std=STDS, seed=99)
    other.load_state_dict(noise.state_dict())
    return other


def through_disk(noise: ObservationNoise) -> ObservationNoise:
    return pickle.loads(pickle.dumps(noise))


@pytest.mark.parametrize("duplicate", [through_state_dict, through_disk, copy.deepcopy], ids=lambda f: f.__name__)
def test_a_copy_continues_the_stream(duplicate) -> None:
    frames = make_frames()
    noise = ObservationNoise(**KEYS, std=STDS, seed=2)
    first = epsilons(noise, frames)
    other = duplicate(noise)
    second = epsilons(noise, frames)
    assert not np.isclose(first, second).any()
    np.testing.assert_array_equal(second, epsilons(other, frames))


def test_a_clone_leaves_the_stream_alone() -> None:
    frames = make_frames()
    noise, undisturbed = (ObservationNoise(**KEYS, std=STDS) for _ in range(2))
    epsilons(noise.clone(), frames)
    np.testing.assert_array_equal(epsilons(noise, frames), epsilons(undisturbed, frames))


def test_env_state_dict_holds_the_stream(fake_grasp, play) -> None:
    env, other = (TransformedEnv(fake_grasp(), ObservationNoise(**KEYS, std=STDS, seed=seed)) for seed in (1, 2))
    play(env, torch.zeros(2, 3, 2))
    other.load_state_dict(env.state_dict())
    one, two = (play(each, torch.zeros(2, 3, 2)) for each in (env, other))
    np.testing.assert_allclose(one["sensed_force"] - one["force"], two["sensed_force"] - two["force"], atol=1e-6)


@pytest.mark.parametrize(("out_keys", "std"), [(["a"], [0.1, 0.1]), (["a", "b"], [0.1]), (["a"], [0.1])])
def test_lengths_must_agree(out_keys: list[str], std: list[float]) -> None:
    with pytest.raises(ValueError, match="one out_key and one std per in_key"):
        ObservationNoise(["joint_position", "force"], out_keys, std)


def test_readings_may_leave_the_bounds_of_the_truth(fake_grasp) -> None:
    check_env_specs(TransformedEnv(fake_grasp(bounded=True), ObservationNoise(**KEYS, std=[0.0, 1.0])))


def test_rounding_comes_after_the_noise() -> None:
    frames, step = make_frames().double(), [1e-3, 0.1]
    noisy, rounded = (ObservationNoise(**KEYS, std=STDS, seed=2, step=s)(frames.clone()) for s in (None, step))
    for key, size in zip(KEYS["out_keys"], step, strict=True):
        np.testing.assert_array_equal(rounded[key], size * (noisy[key] / size).round())
        assert not torch.equal(rounded[key], noisy[key])
