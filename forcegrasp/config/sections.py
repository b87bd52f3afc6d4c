"""Options of what is simulated, observed, rewarded and learned. The only home of their defaults.

Sources: "paper" is Lach et al. (2023), *Towards Transferring Tactile-based Continuous Force Control Policies from
Simulation to Robot*, with its equation or table; "authors' code" is that paper's public code where the paper is silent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from forcegrasp.config.option import is_left_out, of_gripper, option
from forcegrasp.errors import ConfigError
from forcegrasp.observation import DEFAULT_PARTS, PARTS


@dataclass
class PhysicsConfig:
    """How a grasp is simulated."""

    tier: str = option(
        "reference",
        "reference: the paper's physics. fast: sphere for the pads' contact and 8 ms steps, within sensor noise of it",
        choices=("reference", "fast"),
    )
    threads: int = option(0, "physics threads of engine mujoco; 0 uses every core that it may", low=0, high=4096)
    engine: str = option(
        "mujoco",
        "mujoco: on the CPU. warp: MuJoCo Warp, for thousands of grasps on a GPU, see docs/gpu.md",
        choices=("mujoco", "warp"),
    )
    device: str = option("cpu", "where engine warp and the learner compute", choices=("cpu", "cuda"))

    def check(self, path: str) -> None:
        """Refuses a device that the engine can't use."""
        if self.engine == "mujoco" and self.device != "cpu":
            raise ConfigError(f"{path}device={self.device}: engine mujoco runs on the CPU; add physics=warp")


@dataclass
class GraspConfig:
    """What is drawn anew for every grasp. Each range is [low, high], sampled uniformly."""

    kappa: list[float] = option([0.0, 1.0], "softness of the object; 0 is hard", source="paper, Sec. 3", low=0, high=1)
    b2: list[float] = of_gripper(
        [],
        "servo_gain_range",
        "servo gain that is drawn; the paper's velocity gain b₂",
        source="paper, Sec. 3",
        low=-1e6,
        high=1e6,
    )
    servo_gain: str = option(
        "drawn",
        "what stands in for b2 where it is left out: the gripper's range to draw from, or its nominal value",
        choices=("drawn", "nominal"),
    )
    radius_m: list[float] = of_gripper(
        [], "radius_m", "object radius; the paper's w_o", unit="m", source="paper, Table 2", low=1e-4, high=1
    )
    offset_m: list[float] = of_gripper(
        [], "offset_m", "object offset along the grasp axis, o_y", unit="m", source="paper, Table 2", low=-1, high=1
    )
    deformation_m: float = of_gripper(
        math.nan,
        "deformation_m",
        "largest object deformation d_p, both sides together",
        unit="m",
        source="authors' code",
        low=0,
        high=0.5,
    )
    goal_force_min_n: float = of_gripper(
        math.nan, "goal_force_min_n", "smallest goal force", unit="N", source="authors' code", low=1e-4, high=1e4
    )
    goal_force_max: float = option(
        0.95,
        "largest goal force, as a fraction of what the gripper reaches with its largest command step",
        low=0.01,
        high=1,
    )
    steps: int = option(150, "control steps of an episode", source="authors' code", low=1, high=100_000)

    def check(self, path: str) -> None:
        """Refuses objects that could be squeezed flat."""
        check_deformation(self.deformation_m, self.radius_m, f"{path}radius_m")


@dataclass
class SensorConfig:
    """What the controller can measure."""

    position_std_m: float = of_gripper(
        math.nan, "position_std", "noise of the positions, σ_q", unit="m, or rad", source="paper", low=0, high=10
    )
    force_std_n: float = of_gripper(
        math.nan, "force_std_n", "noise of the forces, σ_f", unit="N", source="paper", low=0, high=1000
    )
    contact_threshold_n: float = of_gripper(
        math.nan,
        "contact_threshold_n",
        "force above which a finger is in contact, f_θ",
        unit="N",
        source="authors' code",
        low=0,
        high=1000,
    )


@dataclass
class ObservationConfig:
    """What the policy sees."""

    parts: list[str] = option(
        list(DEFAULT_PARTS),
        "parts of o(t): a number per motor or per force reading each",
        source="paper, Sec. 4",
        choices=PARTS,
    )
    frames: int = option(3, "observations stacked, k", source="paper, Sec. 4", low=1, high=50)


@dataclass
class ActionConfig:
    """What the policy commands."""

    max_delta_m: float = of_gripper(
        math.nan, "max_step", "largest position delta Δq_max", unit="m, or rad", source="paper", low=1e-6, high=10
    )
    inductive_bias: bool = option(True, "scale actions by φ of the contact state", source="paper, eq. 7")
    bias_one_contact: float = option(
        0.1, "φ of a finger that waits for the other", source="paper, eq. 7", low=0, high=1
    )
    bias_floor: float = option(0.9, "smallest φ with both fingers in contact", source="paper, eq. 7", low=0, high=1)
    gentle_touch: float = option(
        0.0,
        "goal, as a share of the gripper's largest force, below which the last finger closes slower on a hard object;"
        " 0: never",
        low=0,
        high=1,
    )


@dataclass
class RewardConfig:
    """r = α₁ r_force + α₂ r_obj + α₃ r_act (paper, eqs. 8-11), and a term of our own for force beyond the goal."""

    form: str = option(
        "paper",
        "r_force = 1 - tanh(Σ|Δf|) (paper) or 1 - tanh(Σ|Δf| / f_goal) (goal_normalised, authors' code)",
        source="paper, eq. 8",
        choices=("paper", "goal_normalised"),
    )
    force_weight: float = option(1.0, "α₁", source="authors' code", low=0, high=1000)
    object_weight: float = option(1.0, "α₂ once the curriculum has ended", source="paper, Table 2", low=0, high=1000)
    action_weight: float = option(0.2, "α₃", source="authors' code", low=0, high=1000)
    speed_threshold_m: float = option(
        5e-5,
        "object speed that is penalised, once the curriculum has ended",
        unit="m per control step",
        source="paper, Table 2",
        low=0,
        high=1,
    )
    overshoot_weight: float = option(
        0.0,
        "weight of r_over = -Σ max(0, f / f_goal - 1 - overshoot_margin), once the curriculum has ended",
        source="own",
        low=0,
        high=1000,
    )
    overshoot_margin: float = option(
        0.05, "force beyond the goal that r_over leaves free, as a fraction of the goal", source="own", low=0, high=10
    )
    forces: str = option(
        "actual",
        "forces that r_force and r_over judge: actual ones, or those measured, before noise; they differ only with a"
        " model",
        choices=("actual", "measured"),
    )


@dataclass
class CurriculumConfig:
    """Where the annealed options start (paper, Table 2); they end at the values given in `reward` and `grasp`."""

    enabled: bool = option(True, "anneal; if not, training starts at the final values")
    end_fraction: float = option(
        1 / 3,
        "share of the training frames after which all is at its final value",
        source="authors' code",
        low=0,
        high=1,
    )
    object_weight: float = option(0.0, "α₂ at the start", source="paper, Table 2", low=0, high=1000)
    speed_threshold_m: float = option(
        2e-4, "velocity threshold at the start", unit="m per control step", source="paper, Table 2", low=0, high=1
    )
    overshoot_weight: float = option(0.0, "weight of r_over at the start", source="own", low=0, high=1000)
    radius_m: list[float] = of_gripper(
        [], "start_radius_m", "object radius at the start", unit="m", source="paper, Table 2", low=1e-4, high=1
    )
    offset_m: list[float] = of_gripper(
        [], "start_offset_m", "object offset at the start", unit="m", source="paper, Table 2", low=-1, high=1
    )


@dataclass
class CollectorConfig:
    """Who simulates the grasps while training."""

    kind: str = option(
        "direct",
        "direct: this process. ray: workers in processes of their own, on this machine or on a Ray cluster's",
        choices=("direct", "ray"),
    )
    workers: int = option(
        1, "processes, each with an equal share of the grasps; physics.threads are each one's own", low=1, high=4096
    )
    address: str = option(
        "local",
        "Ray cluster to use. local: one of this machine, for this run alone. auto: the one that this machine is in",
        choices=("local", "auto"),
    )
    ahead: bool = option(
        True,
        "collect the next batch while the last one is learned from, by the policy before that update, so that no core"
        " waits; false, and with SAC: by the newest policy",
    )

    def check(self, path: str) -> None:
        """Refuses what only Ray has without it."""
        if self.kind == "direct" and (self.workers > 1 or self.address != "local"):
            name, value = ("workers", self.workers) if self.workers > 1 else ("address", self.address)
            raise ConfigError(f"{path}{name}={value}: direct collection is this process alone; add collector=ray")


@dataclass
class LogConfig:
    """What is written while training, and how often. Counted in batches; 0 switches a part off."""

    histograms_every: int = option(5, "batches between histograms of actions and forces", low=0, high=10**9)
    figures_every: int = option(20, "batches between figures of force traces", low=0, high=10**9)
    video_every: int = option(40, "batches between videos; one is made at the end, too", low=0, high=10**9)
    checkpoint_every: int = option(10, "batches between checkpoints", low=1, high=10**9)
    keep: int = option(3, "newest checkpoints kept, beside the best by force reward", low=1, high=10**6)


def check_deformation(deformation_m: float, radius_m: list[float], name: str) -> None:
    """Raises ConfigError unless d_p < r for the smallest object (paper, eq. 3); says nothing of what is left out."""
    if is_left_out(radius_m) or is_left_out(deformation_m):
        return
    if deformation_m >= radius_m[0]:
        raise ConfigError(
            f"{name}={list(radius_m)}: the smallest radius must exceed grasp.deformation_m={deformation_m:g}"
            " (paper, eq. 3): make the object larger or the deformation smaller"
        )
