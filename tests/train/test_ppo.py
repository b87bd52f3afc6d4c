"""PPO against a form of its own in NumPy's float64: advantages, clipped objective, gradient, learning rate."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.stats import multivariate_normal

from forcegrasp.train.algorithms.ppo import Frames
from forcegrasp.train.algorithms.ppo_objective import entropy
from forcegrasp.train.loop import Trainer

HORIZON_OF = {0.9: 10.0, 0.97: 100 / 3}


def numpy(tensor: torch.Tensor) -> np.ndarray:
    return tensor.detach().double().numpy()


def parameters(module: torch.nn.Module) -> dict[str, np.ndarray]:
    return {name: numpy(value) for name, value in module.named_parameters()}


def network(weights: dict[str, np.ndarray], x: np.ndarray) -> np.ndarray:
    """A tanh network, from its weights in order."""
    matrices = [value for name, value in weights.items() if name.endswith("weight")]
    biases = [value for name, value in weights.items() if name.endswith("bias")]
    for index, (matrix, bias) in enumerate(zip(matrices, biases, strict=True)):
        x = np.einsum("ij,...j->...i", matrix, x) + bias
        x = np.tanh(x) if index + 1 < len(matrices) else x
    return x


def policy_mean(weights: dict[str, np.ndarray], observation: np.ndarray, mirrored: bool) -> np.ndarray:
    if not mirrored:
        return network(weights, observation)
    swapped = observation.copy()
    swapped[..., 0::2], swapped[..., 1::2] = observation[..., 1::2], observation[..., 0::2]
    return 0.5 * (network(weights, observation) + network(weights, swapped)[..., [1, 0]])


def log_std(weights: dict[str, np.ndarray]) -> np.ndarray:
    return next(value for name, value in weights.items() if name.endswith("scale"))


def log_probability(weights: dict[str, np.ndarray], frames: dict[str, np.ndarray], mirrored: bool) -> np.ndarray:
    z = (frames["action"] - policy_mean(weights, frames["observation"], mirrored)) / np.exp(log_std(weights))
    return (-0.5 * z**2 - log_std(weights) - 0.5 * np.log(2 * np.pi)).sum(-1)


def state_value(weights: dict[str, np.ndarray], frames: dict[str, np.ndarray], config) -> np.ndarray:
    kappa, b2, radius, offset, goal = np.moveaxis(frames["grasp_parameters"], -1, 0)
    object_y, position = frames["object_position"][..., 0], frames["joint_position"]
    true_state = [
        (kappa - 0.5) / 0.5,
        (b2 + 9.5) / 3.5,
        (radius - 0.025) / 0.01,
        offset / 0.012,
        (goal - 0.5) / 0.5,
        *np.moveaxis(frames["force"], -1, 0),
        100 * (object_y - radius + position[..., 0]),
        100 * (position[..., 1] - object_y - radius),
        1000 * (object_y - offset),
    ]
    seen = frames["observation"]
    if config.critic == "privileged":
        seen = np.concatenate([seen, np.stack(true_state, axis=-1)], axis=-1)
    return HORIZON_OF[config.discount] * network(weights, seen)[..., 0]


KEYS = ("observation", "grasp_parameters", "force", "joint_position", "object_position")


def numpy_frames(batch) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    now = {key: numpy(batch[key]) for key in (*KEYS, "action", "action_log_prob")}
    after = {key: numpy(batch["next", key]) for key in KEYS}
    return now, after


def advantages(trainer: Trainer, batch) -> tuple[np.ndarray, np.ndarray]:
    """Generalised advantages and value targets of episodes that are cut off, not ended, ``(n, T)``."""
    config, weights = trainer.config.ppo, parameters(trainer.algorithm.value)
    now, after = numpy_frames(batch)
    value, next_value = state_value(weights, now, config), state_value(weights, after, config)
    delta = numpy(batch["next", "reward"])[..., 0] + config.discount * next_value - value
    advantage = np.zeros_like(delta)
    running = np.zeros(len(delta))
    for t in reversed(range(delta.shape[1])):
        running = delta[:, t] + config.discount * config.gae_lambda * running
        advantage[:, t] = running
    return advantage, advantage + value


@pytest.fixture(params=["privileged mirrored", "observation"])
def trainer(request, tiny) -> Trainer:
    one_update = {"epochs": 1, "minibatch": 10_000, "grasps": 3, "hidden": [8, 5], "max_grad_norm": 1000.0}
    ppo = {"discount": 0.97, "gae_lambda": 0.8, "clip": 0.15, "entropy_weight": 0.07, "value_weight": 0.6}
    networks = {"critic": request.param.split()[0], "mirrored": "mirrored" in request.param}
    made = Trainer(tiny(grasp={"steps": 40}, ppo=one_update | ppo | networks))
    with torch.no_grad():
        # away from the start, where the policy's mean hardly depends on what it sees
        for parameter in [*made.policy.parameters(), *made.algorithm.value.parameters()]:
            parameter += 0.1 * torch.randn_like(parameter)
    return made


@pytest.fixture
def batch(trainer):
    with torch.no_grad():
        episodes = trainer.env.rollout(40, trainer.policy)
    assert episodes["next", "truncated"][:, -1].all()
    assert episodes["next", "force"].any(), "the fingers must arrive"
    trainer.algorithm.prepare(episodes)
    # as if the policy had moved on in this update: some ratios lie beyond the clip
    episodes["action_log_prob"] += 0.3 * torch.randn(episodes.shape)
    return episodes


def objective(trainer, frames, advantage, target, policy, value) -> dict[str, float]:
    config = trainer.config.ppo
    log_ratio = log_probability(policy, frames, config.mirrored) - frames["action_log_prob"]
    ratio = np.exp(log_ratio)
    normal = (advantage - advantage.mean()) / advantage.std(ddof=1)
    clipped = np.clip(ratio, 1 - config.clip, 1 + config.clip)
    parts = {
        "loss_objective": -np.minimum(ratio * normal, clipped * normal).mean(),
        "loss_critic": config.value_weight * ((state_value(value, frames, config) - target) ** 2).mean(),
        "entropy": (log_std(policy) + 0.5 * np.log(2 * np.pi * np.e)).sum(),
        "kl_approx": -log_ratio.mean(),
        "clip_fraction": (clipped != ratio).mean(),
        "ESS": ratio.sum() ** 2 / (ratio**2).sum() / ratio.size,
        "learning_rate": config.learning_rate,
        "action_std": np.exp(log_std(policy)).mean(),
    }
    parts["total"] = (
        parts["loss_objective"]
        + parts["loss_critic"] / HORIZON_OF[config.discount] ** 2
        - config.entropy_weight * parts["entropy"]
    )
    return parts


def test_advantages(trainer, batch):
    advantage, target = advantages(trainer, batch)
    normal = (advantage - advantage.mean()) / advantage.std(ddof=1)
    np.testing.assert_allclose(numpy(batch["advantage"])[..., 0], normal, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(numpy(batch["value_target"])[..., 0], target, rtol=1e-4, atol=1e-4)


def test_a_policy_that_has_moved_on_since_a_batch_was_collected(trainer, batch):
    """Advantages count by how much likelier their actions are now, and ratios are to the policy as it is now."""
    then = log_probability(parameters(trainer.policy), numpy_frames(batch)[0], trainer.config.ppo.mirrored)
    batch["action_log_prob"] = torch.as_tensor(then, dtype=torch.float32)
    last = [*trainer.policy.parameters()][-1]
    with torch.no_grad():
        last += 0.2
    trainer.algorithm.prepare(batch)
    now = log_probability(parameters(trainer.policy), numpy_frames(batch)[0], trainer.config.ppo.mirrored)
    assert np.abs(now - then).max() > 0.1
    np.testing.assert_allclose(numpy(batch["action_log_prob"]), now, rtol=1e-4, atol=1e-4)
    advantage = advantages(trainer, batch)[0]
    normal = (advantage - advantage.mean()) / advantage.std(ddof=1)
    np.testing.assert_allclose(numpy(batch["advantage"])[..., 0], normal * np.exp(now - then), rtol=1e-3, atol=1e-4)


def test_what_an_update_reports(trainer, batch):
    expected = objective(
        trainer,
        numpy_frames(batch)[0],
        *advantages(trainer, batch),
        parameters(trainer.policy),
        parameters(trainer.algorithm.value),
    )
    reported = trainer.algorithm.learn(batch)
    assert 0.1 < reported["clip_fraction"] < 0.9
    assert set(reported) <= set(expected)
    for name, value in reported.items():
        assert value == pytest.approx(expected[name], rel=1e-3, abs=1e-5), name


def test_advantages_are_normalised_over_the_batch_and_not_the_minibatch(trainer, batch):
    config = trainer.algorithm.config
    config.learning_rate, config.minibatch, config.epochs = 0.0, 8, 2
    trainer.algorithm.set_progress(0.0)
    expected = objective(
        trainer,
        numpy_frames(batch)[0],
        *advantages(trainer, batch),
        parameters(trainer.policy),
        parameters(trainer.algorithm.value),
    )
    reported = trainer.algorithm.learn(batch)
    for name in ("loss_objective", "loss_critic", "kl_approx", "clip_fraction"):
        assert reported[name] == pytest.approx(expected[name], rel=1e-3, abs=1e-5), name


def test_gradient(trainer, batch):
    frames, (advantage, target) = numpy_frames(batch)[0], advantages(trainer, batch)
    policy, value = parameters(trainer.policy), parameters(trainer.algorithm.value)
    trainer.algorithm.learn(batch)
    rng = np.random.default_rng(0)
    for module, weights in ((trainer.policy, policy), (trainer.algorithm.value, value)):
        for name, parameter in module.named_parameters():
            place = tuple(rng.integers(size) for size in weights[name].shape)
            centre, slopes = weights[name][place], []
            for shift in (1e-6, -1e-6):
                weights[name][place] = centre + shift
                slopes.append(objective(trainer, frames, advantage, target, policy, value)["total"])
            weights[name][place] = centre
            expected = (slopes[0] - slopes[1]) / 2e-6
            assert float(parameter.grad[place]) == pytest.approx(expected, rel=5e-3, abs=2e-5), name


def test_gradients_are_scaled_down(trainer, batch, tiny):
    trainer.algorithm.config.max_grad_norm = 0.01
    trainer.algorithm.learn(batch)
    for net in (trainer.policy, trainer.algorithm.value):
        norm = torch.stack([parameter.grad.norm() for parameter in net.parameters()]).norm()
        assert float(norm) == pytest.approx(0.01, rel=1e-3)


def spy_on(lookup, seen):
    """A lookup of minibatches that also notes down whose turn it is."""

    def noted(self, ids):
        frames = lookup(self, ids)
        seen.append(frames["action_log_prob"].flatten())
        return frames

    return noted


@pytest.mark.parametrize("minibatch", [32, 60, 120, 10_000])
def test_every_epoch_sees_every_frame_once(trainer, batch, minibatch, monkeypatch):
    trainer.algorithm.config.minibatch, trainer.algorithm.config.epochs = minibatch, 3
    seen = []
    monkeypatch.setattr(Frames, "__getitem__", spy_on(Frames.__getitem__, seen))
    trainer.algorithm.learn(batch)
    per_epoch = -(-120 // minibatch)
    assert len(seen) == 3 * per_epoch
    epochs = [torch.cat(seen[first : first + per_epoch]) for first in range(0, len(seen), per_epoch)]
    for epoch in epochs:
        assert torch.equal(epoch.sort().values, batch["action_log_prob"].flatten().sort().values)
    assert not torch.equal(epochs[0], epochs[1])


def test_order_of_frames_comes_from_its_own_generator(trainer, batch, monkeypatch):
    trainer.algorithm.config.minibatch = 30
    firsts = []
    monkeypatch.setattr(Frames, "__getitem__", spy_on(Frames.__getitem__, firsts))
    before = torch.get_rng_state()
    trainer.algorithm.shuffle.manual_seed(1)
    trainer.algorithm.learn(batch)
    trainer.algorithm.shuffle.manual_seed(1)
    trainer.algorithm.learn(batch)
    assert torch.equal(firsts[0], firsts[4])
    assert torch.equal(before, torch.get_rng_state())


@pytest.mark.parametrize("share", [-1.0, 0.0, 0.25, 0.5, 1.0, 1.5])
def test_learning_rate_falls_linearly(tiny, share):
    ppo = Trainer(tiny(ppo={"learning_rate": 0.01, "learning_rate_end": 0.1})).algorithm
    expected = np.interp(share, [0, 1], [0.01, 0.001])
    ppo.set_progress(share)
    assert [group["lr"] for group in ppo.optimizer.param_groups] == pytest.approx([expected], rel=1e-12)


def test_a_rate_of_zero_changes_no_weight(trainer, batch):
    trainer.algorithm.config.learning_rate = 0.0
    trainer.algorithm.set_progress(0.0)
    before = parameters(trainer.policy) | parameters(trainer.algorithm.value)
    trainer.algorithm.learn(batch)
    after = parameters(trainer.policy) | parameters(trainer.algorithm.value)
    assert all(np.array_equal(before[name], after[name]) for name in before)


def test_entropy():
    scale = torch.tensor([[0.1, 2.0], [1.0, 0.5]])
    expected = np.mean([multivariate_normal(cov=np.diag(row**2)).entropy() for row in scale.double().numpy()])
    assert float(entropy(scale)) == pytest.approx(expected, rel=1e-6)


def test_the_value_network_sees_the_true_gaps(tiny):
    """A finger reads a force only once the gap on its own side, which the value network computes, has closed."""
    config = tiny(
        grasp={"steps": 60, "offset_m": [0.004, 0.004], "radius_m": [0.03, 0.03], "kappa": [0.0, 0.0]},
        curriculum={"enabled": False},
        collector={"ahead": False},
    )
    trainer = Trainer(config)
    seen = []
    trainer.algorithm.value.module.net.register_forward_pre_hook(lambda _, inputs: seen.append(inputs[0]))
    trainer.collect()
    with torch.no_grad():
        episodes = trainer.env.rollout(60, lambda td: td.set("action", -torch.ones(2, 2)))
        trainer.algorithm.value(episodes)
    force, gap_cm = episodes["force"], seen[0][..., -3:-1]
    free = force == 0
    assert free.any(dim=1).all()
    assert (~free).any(dim=1).all()
    assert (gap_cm[free] > -0.01).all()
    assert (gap_cm[~free] < 0.05).all()
