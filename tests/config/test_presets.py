"""Presets in conf/: every one composes, changes what its name says, and repeats no default."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import pytest
import yaml

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.cli.options import SCHEMAS, compose, compose_sweep, groups, leaves
from forcegrasp.config import EvaluateConfig, TrainConfig, is_left_out
from forcegrasp.physics import load_gripper, shipped_grippers
from forcegrasp.physics.completion import complete
from forcegrasp.runs.provenance import DEFAULT_EXPERIMENT

CONF = Path(__file__).parents[2] / "conf"
FILES = sorted(CONF.glob("*/**/*.yaml"))
EXPERIMENTS = sorted(path.stem for path in CONF.glob("experiment/*.yaml"))
SWEEPS = sorted(path.stem for path in CONF.glob("sweep/*.yaml"))
#: Presets that set options; those of ``sweep`` tell Hydra's sweeper what to combine.
CHOICES = [
    (verb, path.parent.name, path.stem)
    for verb in SCHEMAS
    for path in FILES
    if path.parent.name in set(groups(verb)) - {"sweep"}
]


def preset(verb: str, group: str, choice: str) -> Path:
    """The file of a preset; those of one verb alone lie in a folder of its name."""
    own = CONF / verb / group / f"{choice}.yaml"
    return own if own.exists() else CONF / group / f"{choice}.yaml"


def options(config) -> dict:
    """Every option's value; None where it is left to the gripper (NaN does not equal itself)."""
    return {n: None if e.metadata["of_gripper"] and is_left_out(v) else v for n, e, v in leaves(config)}


def changed(before, after) -> dict:
    """Options that differ, with their new value."""
    old = options(before)
    return {name: value for name, value in options(after).items() if value != old[name]}


@functools.cache  # several tests look at one
def composed(verb: str, *overrides: str) -> Any:
    return compose(verb, list(overrides))


def train(*overrides: str) -> TrainConfig:
    return composed("train", *overrides)


def default_choices(verb: str) -> dict[str, str]:
    entries = yaml.safe_load((CONF / f"{verb}.yaml").read_text())["defaults"]
    picked = {}
    for entry in entries:
        picked |= {key.split("/")[-1]: choice for key, choice in entry.items()} if isinstance(entry, dict) else {}
    return {group: choice for group, choice in picked.items() if not group.startswith("override")}


def bases(path: Path) -> list[str]:
    """The presets of its own group that a preset begins with."""
    entries = yaml.safe_load(path.read_text()).get("defaults", [])
    return [entry for entry in entries if isinstance(entry, str) and entry != "_self_"]


def named_options(path: Path) -> dict:
    """Options that a preset's file names itself, by their full names."""
    text = path.read_text()
    prefix = "" if "@package _global_" in text else f"{path.parent.name}."
    found: dict = {}

    def walk(node: dict, head: str) -> None:
        for key, value in node.items():
            if isinstance(value, dict):
                walk(value, f"{head}{key}.")
            else:
                found[f"{head}{key}"] = value

    walk({key: value for key, value in yaml.safe_load(text).items() if key != "defaults"}, prefix)
    return found


@pytest.mark.parametrize(("verb", "schema"), SCHEMAS.items())
def test_without_presets_the_dataclasses_speak(verb, schema):
    assert composed(verb) == schema()


def test_every_group_is_offered():
    assert set(groups("train")) | set(groups("evaluate")) == {path.parent.name for path in FILES}
    assert set(groups("evaluate")) == {"physics", "plan", "sensors"}


@pytest.mark.parametrize(("verb", "group", "choice"), CHOICES)
def test_preset_sets_what_its_file_says(verb, group, choice):
    found = options(composed(verb, f"{group}={choice}"))
    named = named_options(preset(verb, group, choice))
    assert {name: found[name] for name in named} == named


@pytest.mark.parametrize(("verb", "group", "choice"), CHOICES)
def test_preset_changes_something_unless_it_is_the_default(verb, group, choice):
    config = composed(verb, f"{group}={choice}")
    assert bool(changed(SCHEMAS[verb](), config)) == (choice != default_choices(verb)[group])


@pytest.mark.parametrize(("verb", "group", "choice"), CHOICES)
def test_defaults_live_in_the_dataclasses(verb, group, choice):
    # only the preset that a verb picks by itself may name what holds without it: choosing it must mean something
    if choice == default_choices(verb)[group]:
        return
    default = options(composed(verb, *(f"{group}={base}" for base in bases(preset(verb, group, choice)))))
    repeated = [name for name, value in named_options(preset(verb, group, choice)).items() if default[name] == value]
    assert not repeated


@pytest.mark.parametrize("path", sorted(CONF.glob("*.yaml")), ids=lambda path: path.stem)
def test_a_verbs_own_file_brings_presets_and_sets_no_option(path):
    assert set(yaml.safe_load(path.read_text())) <= {"defaults", "hydra"}
    assert groups(path.stem)


def test_no_ib_differs_from_ib_in_the_bias_alone():
    assert changed(train("experiment=ib"), train("experiment=no_ib")) == {"action.inductive_bias": False}


def test_no_rand_differs_from_no_ib_in_the_randomisation_alone():
    assert changed(train("experiment=no_ib"), train("experiment=no_rand")) == {
        "grasp.kappa": [0.5, 0.5],
        "grasp.servo_gain": "nominal",
    }


@pytest.mark.parametrize("name", shipped_grippers())
def test_no_rand_fixes_the_servo_gain_of_each_gripper(name):
    gripper = load_gripper(name)
    grasp = complete(train("experiment=no_rand"), gripper).grasp
    nominal = gripper.parameters[gripper.training.servo_gain].nominal
    assert grasp.b2 == [nominal, nominal]
    assert nominal == -9 or name != DEFAULT_GRIPPER
    assert complete(train("experiment=no_rand", "grasp.b2=[-8,-7]"), gripper).grasp.b2 == [-8.0, -7.0]


def test_no_curriculum_differs_from_ib_in_the_curriculum_alone():
    assert changed(train("experiment=ib"), train("experiment=no_curriculum")) == {"curriculum.enabled": False}


def test_ib_tuned_differs_from_ib_in_reward_form_and_waiting():
    assert changed(train("experiment=ib"), train("experiment=ib_tuned")) == {
        "reward.form": "goal_normalised",
        "action.bias_one_contact": 0.0,
    }


def test_recommended_differs_from_ib_in_what_its_file_says():
    assert changed(train("experiment=ib"), train("experiment=recommended")) == {
        "observation.frames": 10,
        "action.bias_one_contact": 0.0,
        "action.bias_floor": 1.0,
        "action.gentle_touch": 0.3,
        "reward.form": "goal_normalised",
        "reward.overshoot_weight": 2.0,
        "curriculum.enabled": False,
        "ppo.total_frames": 2_500_000,
        "ppo.grasps": 128,
        "ppo.epochs": 6,
        "ppo.minibatch": 256,
        "ppo.hidden": [100, 100],
        "ppo.log_std": -2.0,
        "ppo.learning_rate": 0.001,
        "ppo.squeeze_together": True,
        "ppo.teacher_weight": 100.0,
        "ppo.teacher_weight_end": 0.5,
        "ppo.teacher_feedback": 1.0,
        "ppo.teacher_caution": 1.0,
        "collector.ahead": False,
    }


def test_quick_is_recommended_with_fewer_frames():
    assert changed(train("experiment=recommended"), train("experiment=quick")) == {"ppo.total_frames": 400_000}


def test_recurrent_differs_from_recommended_in_the_memory_and_what_it_wants():
    assert changed(train("experiment=recommended"), train("experiment=recurrent")) == {
        "observation.frames": 1,
        "ppo.memory": 64,
        "ppo.minibatch": 2400,
    }


def test_sac_learns_the_task_of_recommended():
    different = changed(train("experiment=recommended"), train("experiment=sac"))
    task = {name for name in different if name.partition(".")[0] not in ("ppo", "sac")}
    assert task == {"learner", "observation.frames", "curriculum.enabled", "log.checkpoint_every", "collector.ahead"}


def test_catalogue_differs_from_no_ib_in_what_its_file_says():
    assert changed(train("experiment=no_ib"), train("experiment=catalogue")) == {
        "randomise": "catalogue",
        "observation.frames": 10,
        "reward.form": "goal_normalised",
        "reward.overshoot_weight": 0.05,
        "curriculum.enabled": False,
        "ppo.total_frames": 3_500_000,
        "ppo.grasps": 512,
        "ppo.hidden": [100, 100],
        "ppo.log_std": -2.0,
        "ppo.epochs": 3,
        "ppo.minibatch": 768,
        "ppo.learning_rate": 4e-4,
        "collector.ahead": False,
    }


def test_retrain_differs_from_catalogue_in_what_its_file_says():
    assert changed(train("experiment=catalogue"), train("experiment=retrain")) == {
        "start": "catalogue",
        "randomise": "auto",
        "reward.forces": "measured",
        "ppo.total_frames": 3_000_000,
        "ppo.log_std": -1.2,
        "ppo.learning_rate": 8e-4,
    }


@pytest.mark.parametrize(
    ("experiment", "without"),
    [
        ("no_noise", {"sensors.position_std_m": 0.0, "sensors.force_std_n": 0.0}),
        ("no_stacking", {"observation.frames": 1}),
        ("no_had_contact", {"observation.parts": ["position", "force", "force_error", "last_action"]}),
        ("no_last_action", {"observation.parts": ["position", "force", "force_error", "had_contact"]}),
    ],
)
def test_one_part_is_taken_away_at_a_time(experiment, without):
    assert changed(train("experiment=ib"), train(f"experiment={experiment}")) == without


@pytest.mark.parametrize("sweep", SWEEPS)
def test_a_sweep_changes_no_option_by_itself(sweep):
    assert train(f"sweep={sweep}") == TrainConfig()


@pytest.mark.parametrize("sweep", SWEEPS)
def test_a_sweep_holds_presets_that_exist_and_starts_with_all_of_one_seed(sweep):
    swept, _ = compose_sweep([f"sweep={sweep}"])
    assert list(swept) == ([] if sweep == "none" else ["seed", "experiment"])
    for experiment in swept.get("experiment", "ib").split(","):
        train(f"experiment={experiment}")


@pytest.mark.parametrize(
    ("overrides", "name", "value"),
    [
        (["experiment=recommended", "reward=paper"], "reward.form", "paper"),
        (["reward=paper", "experiment=recommended"], "reward.form", "paper"),
        (["experiment=recommended", "reward.form=paper"], "reward.form", "paper"),
        (["action.inductive_bias=true", "experiment=no_ib"], "action.inductive_bias", True),
        (["experiment=no_rand", "grasp.kappa=[0,1]"], "grasp.kappa", [0.0, 1.0]),
        (["sensors=authors", "sensors.force_std_n=0.01"], "sensors.force_std_n", 0.01),
        (["budget=quick", "ppo.total_frames=1000"], "ppo.total_frames", 1000),
        (["physics=reference", "experiment=ib"], "physics.tier", "reference"),
    ],
)
def test_what_is_given_explicitly_wins(overrides, name, value):
    assert options(train(*overrides))[name] == value


def experiments_in(experiment: str) -> list[Path]:
    """Files that an experiment is made of, itself last."""
    path = CONF / "experiment" / f"{experiment}.yaml"
    others = [name for name in yaml.safe_load(path.read_text()).get("defaults", []) if isinstance(name, str)]
    return [file for name in others if name != "_self_" for file in experiments_in(name)] + [path]


@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_experiments_mix_with_every_other_preset(experiment):
    others = {"budget": "quick", "physics": "reference", "reward": "goal_normalised", "sensors": "authors"}
    others["collector"] = "ray"
    assert {"experiment", "sweep", *others} == set(groups("train"))
    own = {name: value for made_of in experiments_in(experiment) for name, value in named_options(made_of).items()}
    mixed = options(train(f"experiment={experiment}", *(f"{group}={choice}" for group, choice in others.items())))
    for group, choice in others.items():
        # an ablation stays one: what it takes away, no other preset brings back
        named = named_options(preset("train", group, choice)) | own
        assert {name: mixed[name] for name in named} == named


def test_the_default_experiment_is_the_one_that_runs_are_named_after():
    assert default_choices("train")["experiment"] == DEFAULT_EXPERIMENT


def test_training_is_fast_and_evaluation_faithful_by_default():
    assert TrainConfig().physics.tier == "fast"
    assert EvaluateConfig().physics.tier == "reference"


def test_default_configs_share_no_lists():
    one, other = TrainConfig(), TrainConfig()
    one.grasp.kappa[0] = 0.9
    one.ppo.hidden.append(3)
    assert other == TrainConfig()
