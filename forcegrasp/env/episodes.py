"""What happened in a batch of whole episodes: the metrics that training logs and evaluation report."""

from __future__ import annotations

from jaxtyping import Bool, Float
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
    "displacement_after_grasped_mm": "|object displacement| from then on, mm",
    "displacement_total_mm": "|object displacement| over the episode, mm",
    "fast_steps": "control steps in which the object was faster than the threshold",
    "action_change": "Σ_t Σ_i |a_i(t-1) - a_i(t)|",
    "first_contact_s": "time until one finger touches, s (the episode's length if never)",
    "both_contact_s": "time until both fingers have touched, s (the episode's length if never)",
    "reach_s": "time until both forces are within 2 σ_f of the goal, s (the episode's length if never)",
    "settled_s": "time from which both forces stay within 2 σ_f of the goal, s (the episode's length if never)",
    "peak_force_n": "largest force of a finger, N",
    "overshoot_n": "largest force of a finger beyond the goal, N",
    "overshoot_percent": "the same, % of the goal",
    "impact_impulse_ns": "∫ max(0, f - f_goal) dt in the first 0.5 s of a finger's contact, the larger of both, N s",
    "final_force_error_n": "mean |Δf| per finger over the last second (steady error), N",
    "final_force_difference_n": "mean |f_left - f_right| over the last second, most of it of tangential forces, N",
    "command_effort": "root mean square of the commanded position step q_des - q, m or rad",
    "crushed_percent": "100 where a force is beyond 1.5 × goal for more than 40 ms, else 0: of many grasps a share",
    "lost_percent": "100 where a finger does not touch throughout the last second, else 0: of many grasps a share",
}
#: An impact lasts 0.5 s at most; longer contact is quasi-static (ISO/TS 15066:2016, transient contact).
IMPACT_S = 0.5
#: A force this many times the goal, for longer than this, crushes.
CRUSHING, CRUSHING_S = 1.5, 0.04


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
    near = (error < 2 * sensors.force_std_n).all(-1)
    reached, settled = near.cummax(dim=1).values, near.flip(1).cummin(dim=1).values
    beyond = (force - goal).clamp_min(0)
    impact = touched & (touched.cumsum(dim=1) <= max(1, int(IMPACT_S / period_s + 1e-6)))
    held = force[:, -last_second:] > sensors.contact_threshold_n
    command = after.get("commanded_position") - rollout.get("joint_position")
    return {
        "force_reward_normalised": terms.get("force_normalised").sum((1, 2)),
        "force_reward_paper": terms.get("force_paper").sum((1, 2)),
        "force_reward_measured": normalised_force_reward(goal - after.get("measured_force"), goal).sum((1, 2)),
        "displacement_until_grasped_mm": (at_grasp - start).abs() * 1e3,
        "displacement_after_grasped_mm": (position[:, -1] - at_grasp).abs() * 1e3,
        "displacement_total_mm": (position[:, -1] - start).abs() * 1e3,
        "fast_steps": -terms.get("object").sum((1, 2)),
        "action_change": -terms.get("action").sum((1, 2)),
        "first_contact_s": first * period_s,
        "both_contact_s": both * period_s,
        "reach_s": (steps - reached.sum(dim=1)) * period_s,
        "settled_s": (steps - settled.sum(dim=1)) * period_s,
        "peak_force_n": force.amax((1, 2)),
        "overshoot_n": beyond.amax((1, 2)),
        "overshoot_percent": (beyond / goal).amax((1, 2)) * 100,
        "impact_impulse_ns": (beyond * impact).sum(1).amax(1) * period_s,
        "final_force_error_n": error[:, -last_second:].mean((1, 2)),
        "final_force_difference_n": force[:, -last_second:].diff(dim=-1).abs().mean((1, 2)),
        "command_effort": command.square().mean((1, 2)).sqrt(),
        "crushed_percent": 100.0 * _lasting(force > CRUSHING * goal, CRUSHING_S, period_s),
        "lost_percent": 100.0 * ~held.all(1).all(1),
    }


def _lasting(state: Bool[Tensor, "n steps sides"], seconds: float, period_s: float) -> Bool[Tensor, " n"]:
    """Where a state of some side lasts for longer than this without a break; a reading stands for its period."""
    least = int(seconds / period_s + 1e-6) + 1
    if least > state.shape[1]:
        return state.new_zeros(len(state))
    return state.unfold(1, least, 1).all(-1).any(1).any(1)
