"""Options of each verb of the command line: sections that it shares with others, and its own."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.config.algorithms import AlgorithmConfig, PPOConfig, SACConfig
from forcegrasp.config.option import of_gripper, option
from forcegrasp.config.sections import (
    ActionConfig,
    CollectorConfig,
    CurriculumConfig,
    GraspConfig,
    LogConfig,
    ObservationConfig,
    PhysicsConfig,
    RewardConfig,
    SensorConfig,
    check_deformation,
)
from forcegrasp.errors import ConfigError


@dataclass
class TrainConfig:
    """`forcegrasp train`."""

    seed: int = option(0, "seed of everything random", low=0, high=2**31 - 1)
    gripper: str = option(DEFAULT_GRIPPER, "gripper by name, or the path of a description")
    model: str = option("", "file of forcegrasp fit or add: its effects, within fitted intervals")
    start: str = option("", "run or shipped policy whose networks the training begins with")
    randomise: str = option(
        "auto",
        "robots to train on, see docs/robots.md; auto: model, if there is one",
        choices=("auto", "none", "catalogue", "model"),
    )
    learner: str = option(
        "ppo",
        "algorithm that learns; ppo.memory makes PPO recurrent",
        choices=("ppo", "sac"),
    )
    physics: PhysicsConfig = field(default_factory=lambda: PhysicsConfig(tier="fast"))
    grasp: GraspConfig = field(default_factory=GraspConfig)
    sensors: SensorConfig = field(default_factory=SensorConfig)
    observation: ObservationConfig = field(default_factory=ObservationConfig)
    action: ActionConfig = field(default_factory=ActionConfig)
    reward: RewardConfig = field(default_factory=RewardConfig)
    curriculum: CurriculumConfig = field(default_factory=CurriculumConfig)
    ppo: PPOConfig = field(default_factory=PPOConfig)
    sac: SACConfig = field(default_factory=SACConfig)
    collector: CollectorConfig = field(default_factory=CollectorConfig)
    log: LogConfig = field(default_factory=LogConfig)

    @property
    def algorithm(self) -> AlgorithmConfig:
        """Options of the algorithm that learns."""
        return self.sac if self.learner == "sac" else self.ppo

    @property
    def draws_robots(self) -> bool:
        """Whether every grasp has another robot of the prior."""
        return self.randomise == "catalogue"

    def check(self, path: str) -> None:
        """Refuses objects squeezed flat, models that engine or teacher can't have, and shares that workers can't."""
        check_no_effects(self.model, self.physics, f"{path}model={self.model}")
        check_no_effects(self.draws_robots, self.physics, f"{path}randomise={self.randomise}")
        check_deformation(self.grasp.deformation_m, self.curriculum.radius_m, f"{path}curriculum.radius_m")
        if self.randomise == "model" and not self.model:
            raise ConfigError(f"{path}randomise=model: there is none to draw from; name one with model=FILE")
        if self.randomise in ("none", "catalogue") and self.model:
            raise ConfigError(
                f"{path}randomise={self.randomise}: model={self.model} is drawn from, too; leave one of them out"
            )
        if self.collector.kind == "ray" and self.physics.device != "cpu":
            device = f"{path}physics.device={self.physics.device}"
            raise ConfigError(f"{device}: Ray's workers have no GPU; use collector=direct")
        if self.model and self.learner == "ppo" and self.ppo.teacher_weight:
            option = f"{path}ppo.teacher_weight"
            raise ConfigError(
                f"{option}={self.ppo.teacher_weight:g}: the teacher knows the nominal gripper alone; with model= train"
                f" experiment=ib_tuned, or add {option}=0"
            )
        grasps, workers, name = self.algorithm.grasps, self.collector.workers, self.algorithm.name
        if grasps % workers:
            raise ConfigError(
                f"{path}{name}.grasps={grasps} can't be shared equally among {path}collector.workers={workers}:"
                f" make it {-(-grasps // workers) * workers}"
            )


@dataclass
class RecordConfig:
    """`forcegrasp record`."""

    plan: str = option(
        "rich",
        "which grasps: rich has several speeds, pauses, reversals, partial releases, holds and off-centre objects;"
        " close_and_hold is the paper's",
        choices=("rich", "close_and_hold"),
    )
    out: str = option("", "folder for the set; must not exist or be empty; runs/record_TIME if empty")
    effects: list[str] = option([], "effects to record with, each 'NAME [VARIANT] [PARAMETER=VALUE ...]'")
    next: str = option(
        "",
        "diagnosis.json: record the grasp that it proposes instead of a plan; all else as the set was recorded with",
    )
    gripper: str = option(DEFAULT_GRIPPER, "gripper by name, or the path of a description")
    model: str = option("", "model file whose base parameters and effects to record with")
    grasps: int = option(24, "grasps in the set", low=1, high=10_000)
    objects: int = option(4, "objects, grasped in turn; their parameters are drawn", low=1, high=1000)
    off_nominal: float = option(
        0.15, "largest share by which the gripper's base parameters differ from nominal", low=0, high=0.5
    )
    position_std_m: float = of_gripper(
        math.nan, "position_std", "noise of the positions", unit="m, or rad", source="paper", low=0, high=10
    )
    force_std_n: float = of_gripper(
        math.nan, "force_std_n", "noise of the forces", unit="N", source="paper", low=0, high=1000
    )
    samples: str = option("csv", "file format of the samples", choices=("csv", "parquet"))
    seed: int = option(0, "seed of objects, plan and noise", low=0, high=2**31 - 1)


@dataclass
class ImportConfig:
    """`forcegrasp import`."""

    source: list[str] = option([], "files or folders of recordings; also given without source=")
    out: str = option("", "folder for the set; must not exist or be empty; runs/import_TIME if empty")
    format: str = option(
        "map",
        "how the recordings are written; map: as the file of map= says",
        choices=("map", "sage", "bam", "emps", "dfki", "pace", "lerobot"),
    )
    map: str = option("", "file that says which column is what, for any other CSV, Parquet or ROS bag")
    joints: list[str] = option([], "joints to take; all that there are if empty")
    mechanism: str = option("", "what was recorded, by name or description; that of the format if empty")
    license: str = option("", "on what terms the data may be used")
    example: bool = option(False, "write a starter set instead")


def _sets() -> list[str]:
    return option([], "folder of the measurement set, or of several of one gripper to join; also given without data=")


@dataclass
class CompareConfig:
    """`forcegrasp compare`."""

    data: list[str] = _sets()
    model: str = option("", "model file; the gripper's base model, fitted to the set, if empty")
    out: str = option("", "where to write report.html, compare.json and base_model.yaml; runs/compare_TIME if empty")
    seed: int = option(0, "seed of the fit's starts", low=0, high=2**31 - 1)


@dataclass
class FitConfig:
    """`forcegrasp fit`."""

    data: list[str] = _sets()
    out: str = option("", "model file to write; runs/fit_TIME/model.yaml if empty")
    seed: int = option(0, "seed of the fit's starts", low=0, high=2**31 - 1)


@dataclass
class DiagnoseConfig:
    """`forcegrasp diagnose`."""

    data: list[str] = _sets()
    model: str = option("", "model file to start from; the base model is fitted to the set if empty")
    out: str = option("", "where to write report.html, diagnosis.json and models; runs/diagnose_TIME if empty")
    effects: list[str] = option([], "effects to consider; all of the catalogue if empty")
    law: bool = option(False, "look for a formula where no effect explains what is left; takes minutes")
    minutes: float = option(
        0.0, "end after so many minutes, with what was found by then; no limit if 0", unit="min", low=0, high=1e5
    )
    seed: int = option(0, "seed of the fit's starts and of the null distribution", low=0, high=2**31 - 1)


@dataclass
class AddConfig:
    """`forcegrasp add`."""

    data: list[str] = _sets()
    model: str = option("", "model file to add to")
    effect: str = option("", "effect to add, see forcegrasp effects; or the file of a law")
    out: str = option("", "model file to write; runs/add_TIME/model.yaml if empty")


@dataclass
class EvaluateConfig:
    """`forcegrasp evaluate`."""

    policies: list[str] = option(
        ["force_pi"],
        "what to compare: controllers and shipped policies by name, or run directories",
        source="paper, Fig. 2",
    )
    out: str = option("", "where to write; runs/evaluate_TIME if empty")
    detail: bool = option(False, "print all tables, not just the summary; report.html has them anyway")
    baseline: str = option("force_pi", "policy that the others are held against, if it takes part")
    objects: str = option(
        "", "file of objects to grasp instead of a grid of softness values; `paper` has the six of its Table 1"
    )
    kappas: int = option(
        11, "softness values, evenly spaced over grasp.kappa", source="paper, Sec. 5", low=1, high=1001
    )
    trials: int = option(50, "grasps per softness value (or object); the paper had 200 (20)", low=2, high=1_000_000)
    gripper: str = option("", "gripper by name or description; that of the policies if empty")
    seed: int = option(1000, "seed of the grasps; the same grasps for every policy", low=0, high=2**31 - 1)
    model: str = option(
        "", "model file of forcegrasp fit or add to simulate the grasps with; virtual_robot comes with the package"
    )
    robots: int = option(
        0,
        "how many robots of docs/robots.md grasp; 0: the nominal one",
        low=0,
        high=10_000,
    )
    physics: PhysicsConfig = field(default_factory=PhysicsConfig)
    grasp: GraspConfig = field(default_factory=GraspConfig)
    sensors: SensorConfig = field(default_factory=SensorConfig)
    speed_threshold_m: float = option(
        5e-5, "object speed that counts as fast", unit="m per control step", source="paper, Table 2", low=0, high=1
    )

    def check(self, path: str) -> None:
        """Refuses effects on an engine that knows none, and robots that are too few, or a model's as well."""
        check_no_effects(self.model, self.physics, f"{path}model={self.model}")
        check_no_effects(self.robots, self.physics, f"{path}robots={self.robots}")
        if 0 < self.robots < 4:
            raise ConfigError(f"{path}robots={self.robots}: takes 4 at least, two of them for the test")
        if self.robots and self.model:
            raise ConfigError(f"{path}robots={self.robots}: model={self.model} is a robot, too; leave one of them out")


@dataclass
class CurvesConfig:
    """`forcegrasp curves`."""

    folders: list[str] = option([], "folders with runs in or below them; also given without folders=")
    out: str = option("", "where to write curves.png and curves.json; the first folder if empty")


@dataclass
class ExportConfig:
    """`forcegrasp export`."""

    run: str = option("", "run directory or shipped policy, or force_pi; also given without run=")
    out: str = option("", "folder to write; must not exist or be empty; runs/export_TIME if empty")
    gripper: str = option(
        "", "gripper of force_pi by name, or the path of a description; the paper's if empty. A run has its own"
    )
    ceiling_n: float | None = option(
        None,
        "force above which no finger is closed further; a third above what the simulated gripper reaches if left out",
        unit="N",
        low=1e-4,
        high=1e4,
    )


@dataclass
class RenderConfig:
    """`forcegrasp render`."""

    policies: list[str] = option(
        ["force_pi"], "what to show: controllers and shipped policies by name, or run directories; policy= for one"
    )
    out: str = option("", "file to write, NAME.gif or NAME.mp4; runs/render_TIME.gif if empty, and none if live")
    live: bool = option(False, "show the grasp as it is simulated, at the gripper's pace, in MuJoCo's viewer")
    gripper: str = option("", "gripper by name, or the path of a description; that of the policies if empty")
    seed: int = option(0, "seed of what is not given, and of the sensor noise", low=0, high=2**31 - 1)
    kappa: float | None = option(None, "softness of the object; 0 is hard", source="paper, Sec. 3", low=0, high=1)
    b2: float | None = option(
        None, "servo gain that training draws; the paper's velocity gain b₂", source="paper, Sec. 3", low=-1e6, high=1e6
    )
    radius_m: float | None = option(
        None, "object radius; the paper's w_o", unit="m", source="paper, Table 2", low=1e-4, high=1
    )
    offset_m: float | None = option(
        None, "object offset along the grasp axis, o_y", unit="m", source="paper, Table 2", low=-1, high=1
    )
    goal_force_n: float | None = option(None, "goal force of each finger", unit="N", low=1e-4, high=1e4)
    steps: int = option(150, "control steps of the grasp", source="authors' code", low=1, high=1500)
    model: str = option("", "model file of forcegrasp fit or add to simulate the grasp with")
    physics: PhysicsConfig = field(default_factory=PhysicsConfig)
    sensors: SensorConfig = field(default_factory=SensorConfig)

    def check(self, path: str) -> None:
        """Refuses a model on an engine that knows no effects."""
        check_no_effects(self.model, self.physics, f"{path}model={self.model}")


@dataclass
class RobotConfig:
    """`forcegrasp robot`."""

    number: int = option(0, "which robot of plan=robots; also given without number=", low=0, high=2**31 - 1)
    gripper: str = option(DEFAULT_GRIPPER, "whose robot: a gripper by name, or the path of a description")
    out: str = option("", "file to write; robot_NUMBER.yaml if empty")


def check_no_effects(model: object, physics: PhysicsConfig, name: str = "model") -> None:
    """Raises ConfigError if a fitted model is to be simulated by an engine that knows no effects."""
    if model and physics.engine == "warp":
        raise ConfigError(f"{name}: engine warp simulates the nominal gripper alone; use physics.engine=mujoco")
