"""What happened in a batch of whole episodes: the metrics that training logs and evaluation report."""

from __future__ import annotations

from jaxtyping import Float
from tensordict import TensorDictBase
from torch import Tensor

from forcegrasp.config import SensorConfig
from forcegrasp.env.reward import normalised_force_reward
from forcegrasp.physics import default_gripper
from forcegrasp.physics.completion import complete

#: Metric → what it is. All of shape ``(n,)``, one per episode.
METRICS = {
    "force_reward_normalised": "Σ_t of r_force, authors' form (150 at best)",
    "force_reward_paper": "Σ_t of r_force, paper's form (150 at best)",
    "force_reward_measured": "Σ_t of r_force, authors' form, of what the sensors say before noise, as a robot has it",
    "displacement_until_grasped_mm": "|object displacement| until both fingers have touched, mm",
    "displacement_total_mm": "|object displacement| over the episode, mm",
    "fast_steps": "control steps in which the object was faster than the threshold",
    "action_change": "Σ_t Σ_i |a_i(t-1) - a_i(t)|",
    "first_contact_s": "time until one finger touches, s (the episode's length if never)",
    "both_contact_s": "time until both fingers have touched, s (the episode's length if never)",
    "reach_s": "time until both forces are within 2 σ_f of the goal, s (the episode's length if never)",
    "overshoot_percent": "largest force of a finger beyond the goal, % of the goal",
    "final_force_error_n": "mean |Δf| per finger over the last second, N",
}


def summarise(
    rollout: TensorDictBase, sensors: SensorConfig, period_s: float | None = None
) -> dict[str, Float[Tensor, " n"]]:
    """Metrics of every episode, from the true state.

    Args:
      rollout: whole episodes as an env's ``rollout`` gives them, batch ``(n, T)``.
      sensors: f_θ, the true force above which a finger counts as touching, and σ_f, half the band around the goal.
      period_s: seconds per step; the paper's by default.

    Returns:
      One tensor ``(n,)`` per entry of :data:`METRICS`.
    """
    sensors, period_s = complete(sensors, default_gripper()), period_s or default_gripper().period_s
    after = rollout.get("next")
    terms = after.get("reward_terms")
    force, position = after.get("force"), after.get("object_position").squeeze(-1)
    start = rollout.get("object_position")[:, 0, 0]
    steps = force.shape[1]

    touched = (force > sensors.contact_threshold_n).cummax(dim=1).values
    # steps before the first (second) finger has touched
    first, both = (steps - t.sum(dim=1) for t in (touched.any(-1), touched.all(-1)))
    at_grasp = position.gather(1, both.clamp_max(steps - 1).unsqueeze(1)).squeeze(1)
    last_second = max(1, min(steps, round(1 / period_s)))
    goal = after.get("goal_force")
    error = (goal - force).abs()
    reached = (error < 2 * sensors.force_std_n).all(-1).cummax(dim=1).values
    return {
        "force_reward_normalised": terms.get("force_normalised").sum((1, 2)),
        "force_reward_paper": terms.get("force_paper").sum((1, 2)),
        "force_reward_measured": normalised_force_reward(goal - after.get("measured_force"), goal).sum((1, 2)),
        "displacement_until_grasped_mm": (at_grasp - start).abs() * 1e3,
        "displacement_total_mm": (position[:, -1] - start).abs() * 1e3,
        "fast_steps": -terms.get("object").sum((1, 2)),
        "action_change": -terms.get("action").sum((1, 2)),
        "first_contact_s": first * period_s,
        "both_contact_s": both * period_s,
        "reach_s": (steps - reached.sum(dim=1)) * period_s,
        "overshoot_percent": ((force - goal) / goal).amax((1, 2)).clamp_min(0) * 100,
        "final_force_error_n": error[:, -last_second:].mean((1, 2)),
    }
