"""Every option of train changes something: with it, a tiny training leaves other results behind."""

from __future__ import annotations

from typing import Any

import pytest

from forcegrasp.cli.main import main
from forcegrasp.cli.options import leaves
from forcegrasp.config import TrainConfig
from forcegrasp.errors import ConfigError
from forcegrasp.train.loop import Trainer
from tests.config.tiny_runs import ELSEWHERE, MODEL, SHARED_CASES, TINY_TRAINING, trained, with_options

pytestmark = pytest.mark.usefixtures("undrawn")

#: Options of who collects with Ray.
RAY = ("collector.kind", "collector.workers", "collector.address")

#: Options that are nothing without a teacher.
TEACHING = ("ppo.teacher_weight_end", "ppo.teacher_feedback", "ppo.teacher_caution")

#: Sections whose options are nothing to PPO.
OTHERWISE = ("sac.",)

#: Option → another value than in the tiny training.
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
    "action.gentle_touch": 1.0,
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
    "ppo.total_frames": 121,
    "ppo.grasps": 3,
    "ppo.hidden": [8, 8],
    "ppo.log_std": -2.0,
    "ppo.initial_action": -0.8,
    "ppo.mirrored": False,
    "ppo.squeeze_together": True,
    "ppo.memory": 3,
    "ppo.epochs": 3,
    "ppo.minibatch": 20,
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
    "sac.total_frames": 121,
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


def test_every_option_of_train_has_a_case():
    assert list(TRAIN_CASES) == [name for name, *_ in leaves(TrainConfig)]


def test_the_same_training_leaves_the_same(tmp_path, plain_training):
    assert trained(tmp_path) == plain_training


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
