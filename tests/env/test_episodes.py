"""Figures of whole episodes, against loops over steps."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from tensordict import TensorDict

from forcegrasp.config import SensorConfig
from forcegrasp.env.episodes import METRICS, summarise

# A wide band, which random forces meet now and then.
SENSORS = SensorConfig(contact_threshold_n=0.05, force_std_n=0.15)


def _random_rollout(n: int, steps: int, seed: int) -> TensorDict:
    """Random episodes; the first never touches, the second at once with both fingers, the third with one only."""
    generator = torch.Generator().manual_seed(seed)

    def uniform(*shape: int) -> torch.Tensor:
        return torch.rand(*shape, generator=generator)

    start = uniform(n, 1, 1) * 0.02 - 0.01
    position = start + ((uniform(n, steps, 1) - 0.5) * 1e-3).cumsum(1)
    before = torch.cat([start, position[:, :-1]], 1)
    onset = (uniform(n, 1, 2) * 1.2 * steps).floor()
    onset[0], onset[1], onset[2] = steps, 0, torch.tensor([steps, steps // 2])
    # contact comes and goes after the onset, as it does for a bouncing finger
    touching = (torch.arange(steps).view(1, -1, 1) >= onset) & (uniform(n, steps, 2) > 0.4)
    touching |= torch.arange(steps).view(1, -1, 1) == onset
    force = torch.where(touching, 0.05 + uniform(n, steps, 2), 0.05 * uniform(n, steps, 2))
    terms = TensorDict(
        {
            "force_paper": uniform(n, steps, 1),
            "force_normalised": uniform(n, steps, 1),
            "object": -(uniform(n, steps, 1) > 0.7).float(),
            "action": -uniform(n, steps, 1),
        },
        batch_size=(n, steps),
    )
    goal = (uniform(n, 1, 1) + 0.1).expand(n, steps, 1)
    read = force + 0.1 * uniform(n, steps, 2)
    after = TensorDict(
        {
            "force": force,
            "measured_force": read,
            "object_position": position,
            "commanded_position": uniform(n, steps, 2),
            "goal_force": goal,
            "reward_terms": terms,
        },
        batch_size=(n, steps),
    )
    now = {"object_position": before, "joint_position": uniform(n, steps, 2)}
    return TensorDict({**now, "next": after}, batch_size=(n, steps))


def _slow(rollout: TensorDict, sensors: SensorConfig, period: float) -> dict[str, np.ndarray]:
    after = rollout["next"]
    force, goal = after["force"].double().numpy(), after["goal_force"].double().numpy()
    position = np.concatenate([rollout["object_position"][:, :1, 0], after["object_position"][..., 0]], axis=1)
    position = position.astype(float)
    commanded, before = after["commanded_position"].double().numpy(), rollout["joint_position"].double().numpy()
    terms = {key: value.double().numpy()[..., 0] for key, value in after["reward_terms"].items()}
    n, steps = force.shape[:2]
    figures: dict[str, list[float]] = {name: [] for name in METRICS}
    for i in range(n):
        had = [False, False]
        first = both = reached = steps
        settled, overshoot, peak, impulse, long, effort = steps, 0.0, 0.0, [0.0, 0.0], 0, 0.0
        lasting, touching = [0, 0], [0, 0]
        grasped_at = position[i, -1]
        for t in range(steps):
            had = [h or f > sensors.contact_threshold_n for h, f in zip(had, force[i, t], strict=True)]
            if any(had) and first == steps:
                first = t
            if all(had) and both == steps:
                both, grasped_at = t, position[i, t + 1]
            close = [abs(goal[i, t, 0] - f) < 2 * sensors.force_std_n for f in force[i, t]]
            reached = t if all(close) and reached == steps else reached
            settled = steps if not all(close) else min(settled, t)
            overshoot, peak = max(overshoot, *(force[i, t] - goal[i, t, 0])), max(peak, *force[i, t])
            for finger, f in enumerate(force[i, t]):
                touching[finger] += had[finger]
                if had[finger] and (touching[finger] * period <= 0.5 + 1e-9 or touching[finger] == 1):
                    impulse[finger] += max(0.0, f - goal[i, t, 0]) * period
                lasting[finger] = lasting[finger] + 1 if f > 1.5 * goal[i, t, 0] else 0
                long = max(long, lasting[finger])
                effort += (commanded[i, t, finger] - before[i, t, finger]) ** 2 / (2 * steps)
        last = range(max(0, steps - max(1, round(1 / period))), steps)
        errors = [abs(goal[i, t, 0] - force[i, t, finger]) for t in last for finger in (0, 1)]
        figures["force_reward_normalised"].append(sum(terms["force_normalised"][i]))
        figures["force_reward_paper"].append(sum(terms["force_paper"][i]))
        apart = np.abs(goal[i] - after["measured_force"][i].double().numpy()).sum(1)
        figures["force_reward_measured"].append(np.sum(1 - np.tanh(apart / goal[i, :, 0])))
        figures["displacement_until_grasped_mm"].append(1000 * abs(grasped_at - position[i, 0]))
        figures["displacement_after_grasped_mm"].append(1000 * abs(position[i, -1] - grasped_at))
        figures["displacement_total_mm"].append(1000 * abs(position[i, -1] - position[i, 0]))
        figures["fast_steps"].append(sum(terms["object"][i] < 0))
        figures["action_change"].append(-sum(terms["action"][i]))
        figures["first_contact_s"].append(first * period)
        figures["both_contact_s"].append(both * period)
        figures["reach_s"].append(reached * period)
        figures["settled_s"].append(settled * period)
        figures["peak_force_n"].append(peak)
        figures["overshoot_n"].append(overshoot)
        figures["overshoot_percent"].append(100 * overshoot / goal[i, 0, 0])
        figures["impact_impulse_ns"].append(max(impulse))
        figures["final_force_error_n"].append(sum(errors) / len(errors))
        net = [abs(force[i, t, 0] - force[i, t, 1]) for t in last]
        figures["final_force_difference_n"].append(sum(net) / len(net))
        figures["command_effort"].append(effort**0.5)
        figures["crushed_percent"].append(100 * (long * period > 0.04 + 1e-9))
        slipped = any(force[i, t, finger] <= sensors.contact_threshold_n for t in last for finger in (0, 1))
        figures["lost_percent"].append(100 * slipped)
    return {name: np.array(values) for name, values in figures.items()}


@pytest.mark.parametrize(("n", "steps", "period"), [(12, 60, 0.04), (7, 25, 0.04), (5, 10, 0.04), (4, 8, 2.0)])
def test_figures_equal_a_loop_over_steps(n, steps, period):
    rollout = _random_rollout(n, steps, seed=steps)
    found, expected = summarise(rollout, SENSORS, period), _slow(rollout, SENSORS, period)
    assert found.keys() == METRICS.keys()
    for name, values in expected.items():
        assert found[name].shape == (n,), name
        np.testing.assert_allclose(found[name], values, rtol=1e-5, atol=1e-5, err_msg=name)
    first, both = found["first_contact_s"], found["both_contact_s"]
    assert first[0] == both[0] == pytest.approx(steps * period)  # never
    assert first[1] == both[1] == 0  # at once
    assert first[2] < both[2] == pytest.approx(steps * period)  # one finger only


def _one_grasp(*forces: float) -> TensorDict:
    """An episode whose goal is 1 N and whose fingers press alike; 150 steps, the last force held to the end."""
    rollout = _random_rollout(3, 150, seed=0)[:1].clone()
    held = torch.full((1, 150, 1), forces[-1])
    held[0, : len(forces), 0] = torch.tensor(forces)
    rollout["next", "force"], rollout["next", "goal_force"] = held.expand(1, 150, 2), torch.ones(1, 150, 1)
    return rollout


@pytest.mark.parametrize(
    ("forces", "crushed", "lost", "settled", "peak", "impulse"),
    [
        ((0.0, 1.0), 0, 0, 0.04, 1.0, 0.0),
        ((0.0, 1.6, 1.0), 0, 0, 0.08, 1.6, 0.6 * 0.04),  # a peak of one reading lasts 40 ms, and not more
        ((0.0, 1.6, 1.7, 1.0), 100, 0, 0.12, 1.7, 1.3 * 0.04),
        ((0.0, 1.6, 1.4, 1.6, 1.0), 0, 0, 0.16, 1.6, 1.6 * 0.04),
        ((1.0, *(1.2,) * 20, 1.5, 1.0), 0, 0, 0.88, 1.5, 11 * 0.2 * 0.04),  # after half a second it is no impact
        ((0.0, 1.0, 0.0), 0, 100, 6.0, 1.0, 0.0),
        ((0.0, 0.0), 0, 100, 6.0, 0.0, 0.0),
    ],
)
def test_what_a_user_asks_of_a_grasp(forces, crushed, lost, settled, peak, impulse):
    found = {name: value.item() for name, value in summarise(_one_grasp(*forces), SensorConfig()).items()}
    assert (found["crushed_percent"], found["lost_percent"]) == (crushed, lost)
    assert found["settled_s"] == pytest.approx(settled)
    assert found["peak_force_n"] == pytest.approx(peak)
    assert found["overshoot_n"] == pytest.approx(max(0.0, peak - 1))
    assert found["impact_impulse_ns"] == pytest.approx(impulse, abs=1e-7)


def test_threshold_decides_what_counts_as_touching():
    rollout = _random_rollout(6, 30, seed=0)
    low, high = summarise(rollout, SENSORS), summarise(rollout, SensorConfig(contact_threshold_n=0.6))
    assert (high["both_contact_s"] >= low["both_contact_s"]).all()
    assert (high["both_contact_s"] > low["both_contact_s"]).any()


def test_noise_decides_what_counts_as_reached():
    rollout = _random_rollout(6, 30, seed=0)
    narrow, wide = (summarise(rollout, SensorConfig(force_std_n=sigma))["reach_s"] for sigma in (0.05, 0.3))
    assert (wide <= narrow).all()
    assert (wide < narrow).any()
