"""Trainings that are over in a blink, and what they leave behind; values of options that change what comes of them."""

from __future__ import annotations

import contextlib
import csv
import io
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure
from mujoco.batch import Batch
from PIL import Image

from forcegrasp.config import TrainConfig, validate
from forcegrasp.physics import load_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.runs import checkpoint
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.loop import train

# As small as can be, yet the fingers arrive, wait for each other and press, and the object moves.
TINY_GRASP = {"grasp.steps": 30, "physics.tier": "fast", "physics.threads": 1}
TINY_TRAINING = TINY_GRASP | {
    "ppo.total_frames": 120,
    "ppo.grasps": 2,
    "ppo.epochs": 2,
    "ppo.minibatch": 30,
    "ppo.hidden": [8],
    "ppo.initial_action": -1.0,
    "ppo.log_std": -1.0,
    "ppo.value_weight": 10.0,  # lest its gradient stays below the largest norm
    "sac.total_frames": 120,
    "sac.grasps": 2,
    "sac.hidden": [8],
    "sac.initial_action": -1.0,
    "sac.log_std": -1.0,
    "sac.buffer": 100,
    "sac.updates": 3,
    "sac.minibatch": 16,
    "curriculum.end_fraction": 1.0,
    "log.checkpoint_every": 1,
    "log.histograms_every": 0,
    "log.figures_every": 0,
    "log.video_every": 0,
}

MODEL = Path(__file__).parent / "model.yaml"

#: Option → another value than in the tiny training and the tiny evaluation.
SHARED_CASES: dict[str, Any] = {
    "physics.tier": "reference",
    "physics.threads": 2,
    "physics.engine": "warp",
    "physics.device": "cuda",
    "grasp.kappa": [0.0, 0.5],
    "grasp.b2": [-9.0, -9.0],
    "grasp.servo_gain": "nominal",
    "grasp.radius_m": [0.03, 0.035],
    "grasp.offset_m": [0.001, 0.002],
    "grasp.deformation_m": 0.008,
    "grasp.goal_force_min_n": 0.1,
    "grasp.goal_force_max": 0.8,
    "grasp.steps": 29,
    "sensors.position_std_m": 0.001,
    "sensors.force_std_n": 0.1,
    "sensors.contact_threshold_n": 0.2,
}

#: They have tests of their own, as they want packages and hardware.
ELSEWHERE = ("physics.engine", "physics.device")


def with_options(config, values: dict[str, Any]):
    for name, value in values.items():
        *path, last = name.split(".")
        owner = config
        for part in path:
            owner = getattr(owner, part)
        assert hasattr(owner, last), name
        setattr(owner, last, value)
    validate(config)
    return config


def tensorboard_tags(folder: Path) -> list[str]:
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        events = EventAccumulator(str(folder)).Reload().Tags()
    return sorted(tag for kind in ("scalars", "histograms", "images") for tag in events[kind])


@contextlib.contextmanager
def threads_asked() -> Iterator[list[int]]:
    """Yields with how many threads each simulation is begun."""
    asked = []

    def engine(model, n, nthread):
        asked.append(nthread)
        return Batch(model, n, nthread)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("forcegrasp.physics.model_fields.Batch", engine)
        yield asked


def _is_outcome(path: Path) -> bool:
    return "tfevents" not in path.name and path.name != "model.yaml"  # the copy of a model repeats the configuration


def trained(folder: Path, **values: Any) -> dict[str, Any]:
    """What a tiny training leaves behind, less what merely repeats its configuration or tells its speed."""
    config = with_options(TrainConfig(), TINY_TRAINING | values)
    config = complete(config, load_gripper(config.gripper))
    run = RunDir.create(folder, config, [])
    with threads_asked() as threads:
        assert train(config, run)
    files = sorted(str(path.relative_to(folder)) for path in folder.rglob("*.*") if _is_outcome(path))
    tensors, _ = checkpoint.read(max(run.checkpoints.iterdir()))
    weights = {name: tensor.tolist() for name, tensor in tensors.items() if name.startswith(("policy", "value"))}
    with open(run.metrics_path, newline="") as file:
        rows = [{k: v for k, v in row.items() if not k.startswith("speed/")} for row in csv.DictReader(file)]
    tags = tensorboard_tags(run.tensorboard)
    return {"files": files, "weights": weights, "rows": rows, "threads": threads, "tags": tags}


def draw_nothing(patch: pytest.MonkeyPatch) -> None:
    """Drawing takes most of the time, and rendering needs OpenGL."""
    gif = io.BytesIO()
    Image.new("P", (2, 2)).save(gif, "GIF")
    patch.setattr("forcegrasp.train.logging.grasp_video", lambda *args, **kwargs: gif.getvalue())
    patch.setattr("forcegrasp.evaluate.compare_policies.force_traces", lambda *args, **kwargs: Figure())
    patch.setattr("forcegrasp.evaluate.compare_policies.cell_boxes", lambda *args, **kwargs: Figure())
    patch.setattr("matplotlib.figure.Figure.savefig", lambda self, path, **kwargs: Path(path).touch())
    patch.setattr("forcegrasp.reports.html._svg", lambda figure: "")
