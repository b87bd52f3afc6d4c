"""Every option of train, evaluate and render changes something: with it, a tiny one leaves other results behind."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure
from mujoco.batch import Batch
from PIL import Image
from rich.console import Console

from forcegrasp.cli.main import main
from forcegrasp.cli.options import leaves
from forcegrasp.config import (
    EvaluateConfig,
    RenderConfig,
    TrainConfig,
    validate,
)
from forcegrasp.errors import ConfigError
from forcegrasp.evaluate.compare_policies import evaluate
from forcegrasp.physics import load_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.runs import checkpoint
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.loop import Trainer, train

# As small as can be, yet the fingers arrive, wait for each other and press, and the object moves.
TINY_GRASP = {"grasp.steps": 45, "physics.tier": "fast", "physics.threads": 1}
TINY_TRAINING = TINY_GRASP | {
    "ppo.total_frames": 180,
    "ppo.grasps": 2,
    "ppo.epochs": 2,
    "ppo.minibatch": 45,
    "ppo.hidden": [8],
    "ppo.initial_action": -1.0,
    "ppo.log_std": -1.0,
    "ppo.value_weight": 10.0,  # lest its gradient stays below the largest norm
    "sac.total_frames": 180,
    "sac.grasps": 2,
    "sac.hidden": [8],
    "sac.initial_action": -1.0,
    "sac.log_std": -1.0,
    "sac.buffer": 150,
    "sac.updates": 3,
    "sac.minibatch": 16,
    "curriculum.end_fraction": 1.0,
    "log.checkpoint_every": 1,
    "log.histograms_every": 0,
    "log.figures_every": 0,
    "log.video_every": 0,
}
TINY_EVALUATION = TINY_GRASP | {"kappas": 2, "trials": 2}

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
    "grasp.steps": 44,
    "sensors.position_std_m": 0.001,
    "sensors.force_std_n": 0.1,
    "sensors.contact_threshold_n": 0.2,
}

#: They have tests of their own, as they want packages and hardware.
ELSEWHERE = ("physics.engine", "physics.device")
#: It wants a display: tests/evaluate/test_live.py.
LIVE = ("live",)

#: Options of who collects with Ray.
RAY = ("collector.kind", "collector.workers", "collector.address")

#: Options that are nothing without a teacher.
TEACHING = ("ppo.teacher_weight_end", "ppo.teacher_feedback", "ppo.teacher_caution")

#: Sections whose options are nothing to PPO.
OTHERWISE = ("sac.",)

#: The same, for the options of training alone.
TRAIN_CASES: dict[str, Any] = {
    "seed": 1,
    "gripper": "franka_hand",
    "model": str(MODEL),
    "start": "ib",
    "randomise": "catalogue",
    "learner": "sac",
    **SHARED_CASES,
    "observation.parts": ["position", "force"],
    "observation.frames": 2,
    "action.max_delta_m": 0.002,
    "action.inductive_bias": False,
    "action.bias_one_contact": 0.5,
    "action.bias_floor": 0.5,
    "reward.form": "goal_normalised",
    "reward.force_weight": 2.0,
    "reward.object_weight": 2.0,
    "reward.action_weight": 1.0,
    "reward.speed_threshold_m": 0.0,
    "reward.overshoot_weight": 1.0,
    "reward.overshoot_margin": 0.0,
    "reward.forces": "measured",
    "curriculum.enabled": False,
    "curriculum.end_fraction": 0.75,
    "curriculum.object_weight": 0.5,
    "curriculum.speed_threshold_m": 0.0,
    "curriculum.overshoot_weight": 1.0,
    "curriculum.radius_m": [0.030, 0.035],
    "curriculum.offset_m": [-0.002, -0.001],
    "ppo.total_frames": 181,
    "ppo.grasps": 3,
    "ppo.hidden": [8, 8],
    "ppo.log_std": -2.0,
    "ppo.initial_action": -0.8,
    "ppo.mirrored": False,
    "ppo.squeeze_together": True,
    "ppo.memory": 3,
    "ppo.epochs": 3,
    "ppo.minibatch": 30,
    "ppo.learning_rate": 1e-3,
    "ppo.learning_rate_end": 0.5,
    "ppo.discount": 0.9,
    "ppo.gae_lambda": 0.5,
    "ppo.clip": 0.001,
    "ppo.entropy_weight": 0.1,
    "ppo.value_weight": 1.0,
    "ppo.max_grad_norm": 1e-3,
    "ppo.critic": "observation",
    "ppo.teacher_weight": 2.0,
    "ppo.teacher_weight_end": 1.0,
    "ppo.teacher_feedback": 1.0,
    "ppo.teacher_caution": 3.0,
    "sac.total_frames": 181,
    "sac.grasps": 3,
    "sac.hidden": [8, 8],
    "sac.log_std": -2.0,
    "sac.initial_action": -0.8,
    "sac.mirrored": False,
    "sac.squeeze_together": True,
    "sac.buffer": 80,
    "sac.updates": 2,
    "sac.minibatch": 15,
    "sac.learning_rate": 3e-3,
    "sac.discount": 0.9,
    "sac.target_rate": 0.1,
    "sac.entropy_weight": 0.1,
    "sac.entropy_target": -1.0,
    "sac.critic": "observation",
    "collector.kind": "ray",
    "collector.workers": 2,
    "collector.address": "auto",
    "collector.ahead": False,
    "log.histograms_every": 1,
    "log.figures_every": 1,
    "log.video_every": 1,
    "log.checkpoint_every": 2,
    "log.keep": 1,
}

#: The same, for the options of evaluation alone.
EVALUATE_CASES: dict[str, Any] = {
    "policies": ["informed"],
    "out": "elsewhere",
    "detail": True,
    "baseline": "run",
    "objects": "paper",
    "kappas": 3,
    "trials": 3,
    "gripper": "franka_hand",
    "seed": 1,
    "model": str(MODEL),
    "robots": 4,
    **SHARED_CASES,
    "speed_threshold_m": 0.0,
}


#: Option → another value than in a rendering of 45 steps of a policy that reads everything.
RENDER_CASES: dict[str, Any] = {
    "policies": "[informed]",
    "out": "elsewhere.gif",
    "live": True,
    "gripper": "franka_hand",
    "seed": 1,
    "kappa": 0.1,
    "b2": -6.5,
    "radius_m": 0.03,
    "offset_m": 0.003,
    "goal_force_n": 0.1,
    "steps": 44,
    "model": str(MODEL),
    "physics.tier": "reference",
    "physics.threads": 2,
    "physics.engine": "warp",
    "physics.device": "cuda",
    "sensors.position_std_m": 0.001,
    "sensors.force_std_n": 0.1,
    "sensors.contact_threshold_n": 0.2,
}


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
        patch.setattr("forcegrasp.physics.plant.Batch", engine)
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


def evaluated(folder: Path, **values: Any) -> dict[str, Any]:
    """What a tiny evaluation finds, less what merely repeats its configuration."""
    report = evaluate(with_options(EvaluateConfig(), TINY_EVALUATION | values), folder, Console(file=io.StringIO()))
    return {"policies": report["policies"], "trials": (folder / "trials.csv").read_text()}


def draw_nothing(patch: pytest.MonkeyPatch) -> None:
    """Drawing takes most of the time, and rendering needs OpenGL."""
    gif = io.BytesIO()
    Image.new("P", (2, 2)).save(gif, "GIF")
    patch.setattr("forcegrasp.train.logging.grasp_video", lambda *args, **kwargs: gif.getvalue())
    patch.setattr("forcegrasp.evaluate.compare_policies.force_traces", lambda *args, **kwargs: Figure())
    patch.setattr("forcegrasp.evaluate.compare_policies.cell_boxes", lambda *args, **kwargs: Figure())
    patch.setattr("matplotlib.figure.Figure.savefig", lambda self, path, **kwargs: Path(path).touch())
    patch.setattr("forcegrasp.reports.html._svg", lambda figure: "")


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch):
    draw_nothing(monkeypatch)


@pytest.fixture(scope="module")
def run_path(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("train") / "run"


@pytest.fixture(scope="module")
def plain_training(run_path):
    return trained(run_path)


@pytest.fixture(scope="module")
def learned(plain_training, run_path) -> dict[str, list[str]]:
    """A policy that sees every reading, which the hand-written controllers do not, and something to hold it against."""
    return {"policies": [str(run_path), "close"], "baseline": "close"}


@pytest.fixture(scope="module")
def plain_evaluation(tmp_path_factory, learned):
    with pytest.MonkeyPatch.context() as patch:
        draw_nothing(patch)
        return evaluated(tmp_path_factory.mktemp("evaluate"), **learned)


def test_every_option_of_train_has_a_case():
    assert list(TRAIN_CASES) == [name for name, *_ in leaves(TrainConfig)]


def test_every_option_of_evaluate_has_a_case():
    assert list(EVALUATE_CASES) == [name for name, *_ in leaves(EvaluateConfig)]


def test_the_same_training_leaves_the_same(tmp_path, plain_training):
    assert trained(tmp_path) == plain_training


def test_the_same_evaluation_finds_the_same(tmp_path, plain_evaluation, learned):
    assert evaluated(tmp_path, **learned) == plain_evaluation


@pytest.mark.parametrize(
    "name",
    [
        n
        for n in TRAIN_CASES
        if n not in ("start", "reward.forces", *TEACHING, *ELSEWHERE, *RAY) and not n.startswith(OTHERWISE)
    ],
)
def test_option_of_train(name, tmp_path, plain_training):
    different = trained(tmp_path, **{name: TRAIN_CASES[name]})
    assert different != plain_training


@pytest.fixture(scope="module")
def plain_sac(tmp_path_factory):
    return trained(tmp_path_factory.mktemp("sac") / "run", learner="sac")


@pytest.mark.parametrize("name", [name for name in TRAIN_CASES if name.startswith("sac.")])
def test_option_of_sac(name, tmp_path, plain_sac):
    assert trained(tmp_path, learner="sac", **{name: TRAIN_CASES[name]}) != plain_sac


def test_option_start_of_train(tmp_path):
    network = {"ppo.hidden": [50, 50]}
    plain = trained(tmp_path / "plain", **network)
    assert trained(tmp_path / "other", **network, start=TRAIN_CASES["start"]) != plain


class JoinedError(Exception):
    """The training would begin now, on this cluster."""


@pytest.mark.parametrize("name", RAY)
def test_option_of_collecting(name, monkeypatch):
    """What is asked of Ray; tests/train/test_collector.py has what comes of it."""

    class Ray:
        is_initialized = staticmethod(lambda: False)

        @staticmethod
        def init(address, **options):
            raise JoinedError({"address": address, **options})

    monkeypatch.setattr("forcegrasp.train.cluster.find_ray", lambda: Ray)

    def asked(**values: Any) -> dict[str, Any] | None:
        try:
            Trainer(with_options(TrainConfig(), TINY_TRAINING | values))
        except JoinedError as asked:
            return asked.args[0]
        return None

    plain = {} if name == "collector.kind" else {"collector.kind": "ray"}
    assert asked(**plain) == asked(**plain) != asked(**plain | {name: TRAIN_CASES[name]})


@pytest.mark.parametrize("name", TEACHING)
def test_option_of_the_teacher(name, tmp_path):
    taught = {"ppo.teacher_weight": 0.5}
    plain = trained(tmp_path / "plain", **taught)
    assert trained(tmp_path / "other", **taught | {name: TRAIN_CASES[name]}) != plain


def test_a_teacher_does_not_know_a_model():
    values = {"model": str(MODEL), "ppo.teacher_weight": 0.5}
    with pytest.raises(ConfigError, match=r"ppo.teacher_weight=0.5: the teacher knows the nominal gripper alone"):
        with_options(TrainConfig(), TINY_TRAINING | values)


def test_forces_that_the_reward_judges_differ_with_a_model(tmp_path):
    model = TRAIN_CASES["model"]
    one, other = (trained(tmp_path / f, **{"model": model, "reward.forces": f}) for f in ("actual", "measured"))
    assert one["weights"] != other["weights"]


@pytest.mark.parametrize(
    "name", [n for n in EVALUATE_CASES if n not in ("gripper", "out", "detail", "physics.threads", *ELSEWHERE)]
)
def test_option_of_evaluate(name, tmp_path, plain_evaluation, learned):
    different = evaluated(tmp_path, **learned | {name: EVALUATE_CASES[name]})
    assert different != plain_evaluation


def test_gripper_of_evaluate_is_simulated_and_moves_no_policy_of_another(tmp_path, learned):
    plain = evaluated(tmp_path / "one", policies=["close"])
    assert evaluated(tmp_path / "two", policies=["close"], gripper=EVALUATE_CASES["gripper"]) != plain
    with pytest.raises(ConfigError, match="was trained on gripper tiago, and can't move franka_hand"):
        evaluated(tmp_path / "three", **learned | {"gripper": EVALUATE_CASES["gripper"]})


@pytest.mark.parametrize("verb", ["train", "evaluate", "render"])
def test_engine_and_device_reach_the_simulator(verb, tmp_path, monkeypatch):
    """What they simulate is tested in tests/gpu; here they may be missing."""
    asked = []

    def begin(n, tier, device, gripper):
        asked.append(device)
        raise ConfigError("enough")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("forcegrasp.env.grasp_env.WarpGraspSimulator", begin)
    monkeypatch.setattr("forcegrasp.gpu.installation.find_spec", lambda name: name)
    monkeypatch.setattr("torch.cuda.is_available", lambda: True)
    for device in ("cpu", "cuda"):
        folder = f"hydra.run.dir={device}" if verb == "train" else f"out={device}{'.gif' * (verb == 'render')}"
        assert main([verb, "physics.engine=warp", f"physics.device={device}", folder]) == 2
    assert asked == ["cpu", "cuda"]


def test_threads_of_evaluate_reach_the_engine(tmp_path):
    with threads_asked() as asked:
        evaluated(tmp_path, **{"physics.threads": EVALUATE_CASES["physics.threads"]})
    assert set(asked) == {2}


def test_out_is_where_evaluate_writes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tiny = [f"{name}={value}" for name, value in TINY_EVALUATION.items()]
    assert main(["evaluate", *tiny, f"out={EVALUATE_CASES['out']}"]) == 0
    assert json.loads((tmp_path / EVALUATE_CASES["out"] / "evaluation.json").read_text())["trials"] == 2


def test_detail_of_evaluate_prints_more(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    tiny = [f"{name}={value}" for name, value in TINY_EVALUATION.items()]
    said = []
    for detail in (False, EVALUATE_CASES["detail"]):
        assert main(["evaluate", *tiny, "out=here", f"detail={detail}"]) == 0
        said.append(capsys.readouterr().out)
    assert "interquartile mean" in said[1]
    assert "interquartile mean" not in said[0]


def test_every_option_of_render_has_a_case():
    assert list(RENDER_CASES) == [name for name, *_ in leaves(RenderConfig)]


def rendered(folder: Path, **values: Any) -> tuple:
    """What would be shown, what is said, where it is written, and with how many threads it was simulated."""
    shown, said = [], io.StringIO()

    def show(episodes, sensors, gripper, mp4):
        shown.extend(episode["next", "force"].tolist() for episode in episodes.values())
        return b"GIF"

    tiny = {"steps": 45, "physics": "fast", "physics.threads": 1, "out": "plain.gif"}
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(said), threads_asked() as threads:
        patch.chdir(folder)
        patch.setattr("forcegrasp.evaluate.render.grasp_video", show)
        assert main(["render", *(f"{name}={value}" for name, value in (tiny | values).items())]) == 0
    return shown, threads, said.getvalue()


@pytest.fixture(scope="module")
def plain_rendering(tmp_path_factory, plain_training, run_path):
    return rendered(tmp_path_factory.mktemp("render"), policies=[str(run_path)])


def test_the_same_rendering_shows_the_same(tmp_path, plain_rendering, run_path):
    assert rendered(tmp_path, policies=[str(run_path)]) == plain_rendering


@pytest.mark.parametrize("name", [name for name in RENDER_CASES if name not in ("gripper", *LIVE, *ELSEWHERE)])
def test_option_of_render(name, tmp_path, plain_rendering, run_path):
    assert rendered(tmp_path, **{"policies": [str(run_path)], name: RENDER_CASES[name]}) != plain_rendering


def test_gripper_of_render_is_the_one_that_grasps(tmp_path):
    plain, other = (rendered(tmp_path, policies="close", **more) for more in ({}, {"gripper": RENDER_CASES["gripper"]}))
    assert plain[0] != other[0]
