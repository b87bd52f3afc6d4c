"""Every option that a command line or YAML may set, as dataclasses: default, unit, bounds, choices and source."""

from forcegrasp.config.algorithms import AlgorithmConfig, PPOConfig, SACConfig
from forcegrasp.config.option import is_left_out, validate
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
from forcegrasp.config.verbs import (
    AddConfig,
    CompareConfig,
    CurvesConfig,
    DiagnoseConfig,
    EvaluateConfig,
    ExportConfig,
    FitConfig,
    RecordConfig,
    RenderConfig,
    TrainConfig,
    check_no_effects,
)

__all__ = [
    "ActionConfig",
    "AddConfig",
    "AlgorithmConfig",
    "CollectorConfig",
    "CompareConfig",
    "CurriculumConfig",
    "CurvesConfig",
    "DiagnoseConfig",
    "EvaluateConfig",
    "ExportConfig",
    "FitConfig",
    "GraspConfig",
    "LogConfig",
    "ObservationConfig",
    "PPOConfig",
    "PhysicsConfig",
    "RecordConfig",
    "RenderConfig",
    "RewardConfig",
    "SACConfig",
    "SensorConfig",
    "TrainConfig",
    "check_deformation",
    "check_no_effects",
    "is_left_out",
    "validate",
]
