"""How TensorBoard shows a training: names that put what matters first, a page of charts, and a card that explains."""

from __future__ import annotations

import shlex

from forcegrasp.config import TrainConfig
from forcegrasp.env.episodes import METRICS
from forcegrasp.runs.provenance import experiment
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.algorithms import Algorithm, algorithm_of

#: What the first screen shows, in its order; TensorBoard sorts by name, hence the numbers.
OVERVIEW = (
    "episode/force_reward_normalised",
    "episode/force_reward_paper",
    "episode/return",
    "episode/displacement_until_grasped_mm",
    "episode/displacement_total_mm",
    "episode/fast_steps",
)
#: Groups of columns; in place of the third, the algorithm's name.
GROUPS = ("overview", "episode", "reward", "algorithm", "curriculum", "speed")

#: Page → chart → columns of metrics.csv drawn in it; the algorithm's own page follows the second.
CHARTS = {
    "Is it learning?": {
        "force reward of an episode": ("episode/force_reward_normalised", "episode/force_reward_paper"),
        "return": ("episode/return",),
        "force error at the end, N": ("episode/final_force_error_n",),
    },
    "Does it push the object?": {
        "object moved, mm": ("episode/displacement_until_grasped_mm", "episode/displacement_total_mm"),
        "steps over the speed threshold": ("episode/fast_steps",),
        "time until contact, s": ("episode/first_contact_s", "episode/both_contact_s"),
    },
    "Is it gentle?": {
        "largest overshoot, % of the goal": ("episode/overshoot_percent",),
        "peak force and overshoot, N": ("episode/peak_force_n", "episode/overshoot_n"),
        "impact impulse beyond the goal, N s": ("episode/impact_impulse_ns",),
        "crushed and lost, % of the grasps": ("episode/crushed_percent", "episode/lost_percent"),
        "time to the goal and until settled, s": ("episode/reach_s", "episode/settled_s"),
    },
    "Curriculum": {
        "weights": ("curriculum/object_weight", "curriculum/overshoot_weight"),
        "object radius, m": ("curriculum/radius_low_m", "curriculum/radius_high_m"),
    },
    "Speed": {"frames per second": ("speed/frames_per_s", "speed/collect_frames_per_s")},
}


def tag(column: str) -> str:
    """TensorBoard's name of a column of metrics.csv: ``episode/return`` is ``1_overview/3_return``."""
    group, name = column.split("/")
    if column in OVERVIEW:
        return f"1_overview/{1 + OVERVIEW.index(column)}_{name}"
    return f"{1 + GROUPS.index(group if group in GROUPS else 'algorithm')}_{group}/{name}"


def layout(algorithm: type[Algorithm]) -> dict[str, dict[str, list]]:
    """The pages of charts, for ``SummaryWriter.add_custom_scalars``; it takes tags as patterns, hence the anchors."""
    pages = list(CHARTS.items())
    return {
        page: {chart: ["Multiline", [f"^{tag(column)}$" for column in columns]] for chart, columns in charts.items()}
        for page, charts in (*pages[:2], *algorithm.CHARTS.items(), *pages[2:])
    }


def evaluate_command(run: RunDir, config: TrainConfig) -> str:
    """What to type to compare a run with the hand-written controller, in the simulator that it was trained in."""
    words = [f"policies=[{run.path},force_pi]", *([f"model={run.model_path}"] if config.model else [])]
    words = ["plan=robots", *words] if config.draws_robots else words
    return shlex.join(["forcegrasp", "evaluate", *words])


def card(run: RunDir, config: TrainConfig) -> str:
    """What this run is, how to go on with it and what the names mean, as Markdown."""
    meanings = "\n".join(f"* `{name}`: {meaning}" for name, meaning in METRICS.items())
    simulator = f"the model `{config.model}`, kept as `{run.model_path}`" if config.model else "the nominal gripper"
    simulator = "another robot in every grasp" if config.draws_robots else simulator
    title = f"{experiment(run.path) or 'training'}, seed {config.seed}" + (config.model and f", model {config.model}")
    return f"""# {title}

{config.algorithm.total_frames:,} frames, {config.algorithm.grasps} grasps at once, reward `{config.reward.form}`,
simulated with {simulator}.

    forcegrasp train resume={run.path}        go on with it, should it have been interrupted
    {evaluate_command(run, config)}        compare it with the hand-written controller
    forcegrasp curves {run.path}        its learning curves as a picture

**Custom scalars** has one page per question: is it learning, does it push the object, is the algorithm healthy, is it
gentle, how fast is it. **Scalars** has everything, what matters first; the numbers in the names only sort. All are
means over a batch of episodes with exploring actions, so `forcegrasp evaluate` finds a little more.

{meanings}
* `return`: sum of all rewards, with the weights of the day: the curriculum changes them
* `3_reward`: terms of the reward, per step and unweighted
* `4_{config.algorithm.name}`: {algorithm_of(config).ADVICE}
* `5_curriculum`: what is annealed; `6_speed`: frames per second, and the share of time that the updates take
"""
