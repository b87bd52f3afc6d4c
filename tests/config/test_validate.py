"""What a configuration refuses: values out of bounds, unknown names, and anything that names code."""

from __future__ import annotations

import math
import re
from itertools import pairwise

import pytest

from forcegrasp.cli.options import HYDRA_OPTIONS, SCHEMAS, compose, compose_run, leaves
from forcegrasp.config import validate
from forcegrasp.errors import ConfigError

LEAVES = [(verb, name, entry, default) for verb, schema in SCHEMAS.items() for name, entry, default in leaves(schema)]


def is_number(value) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def sample(entry, default):
    """A default; of an option that is left to the gripper, a value of its kind."""
    low = entry.metadata["low"]
    return default if not entry.metadata["of_gripper"] else [low, low] if isinstance(default, list) else float(low)


def first(default):
    return default[0] if isinstance(default, list) and default else default


def selected(condition) -> dict:
    every = [(verb, name, entry, sample(entry, default)) for verb, name, entry, default in LEAVES]
    chosen = [leaf for leaf in every if condition(leaf[2].metadata, leaf[3])]
    return {
        "argnames": ("verb", "name", "meta", "default"),
        "argvalues": [(verb, name, entry.metadata, default) for verb, name, entry, default in chosen],
        "ids": [f"{verb}-{name}" for verb, name, *_ in chosen],
    }


NUMBERS = selected(lambda meta, default: is_number(first(default)))
RANGES = selected(lambda meta, default: isinstance(default, list) and isinstance(first(default), float))
LISTS = selected(lambda meta, default: isinstance(default, list) and default and not meta["of_gripper"])
CHOICES = selected(lambda meta, default: meta["choices"])


def test_every_option_says_what_it_means():
    assert all(entry.metadata["doc"] for _, _, entry, _ in LEAVES)


def with_option(verb: str, name: str, value):
    config = SCHEMAS[verb]()
    *path, last = name.split(".")
    owner = config
    for part in path:
        owner = getattr(owner, part)
    assert hasattr(owner, last)
    setattr(owner, last, value)
    if name == "grasp.deformation_m":  # objects it fits into, for its own bounds to be what counts
        for part in (config.grasp, getattr(config, "curriculum", None)):
            if part:
                part.radius_m = [1.0, 1.0]
    if name in ("collector.workers", "collector.address"):  # which direct collection has not, and grasps to share
        config.collector.kind, config.ppo.grasps = "ray", 4096
    return config


def refused(verb: str, name: str, value) -> str:
    with pytest.raises(ConfigError, match=f"^{re.escape(name)}=") as caught:
        validate(with_option(verb, name, value))
    message = str(caught.value)
    assert "\n" not in message
    return message


def like(default, number):
    """``number`` in the place of the default: a number, or a list of as many."""
    return [number] * len(default) if isinstance(default, list) else number


@pytest.mark.parametrize(("verb", "schema"), SCHEMAS.items())
def test_defaults_are_valid(verb, schema):
    validate(schema())


@pytest.mark.parametrize(**NUMBERS)
def test_every_number_has_bounds_and_accepts_them(verb, name, meta, default):
    assert math.isfinite(meta["low"])
    assert math.isfinite(meta["high"])
    for bound in (meta["low"], meta["high"]):
        validate(with_option(verb, name, like(default, type(first(default))(bound))))


@pytest.mark.parametrize(**NUMBERS)
def test_numbers_out_of_bounds_are_refused(verb, name, meta, default):
    low, high = meta["low"], meta["high"]
    if isinstance(first(default), int):
        below, above = int(low) - 1, int(high) + 1
    else:
        below, above = math.nextafter(low, -math.inf), math.nextafter(high, math.inf)
    for value in (below, above, -math.inf, math.inf, *([] if meta["of_gripper"] else [math.nan])):
        message = refused(verb, name, like(default, value))
        assert "must lie in" in message


@pytest.mark.parametrize(**RANGES)
def test_ranges_are_two_numbers_in_order(verb, name, meta, default):
    low, high = meta["low"], meta["high"]
    validate(with_option(verb, name, [low, high]))
    validate(with_option(verb, name, [low, low]))
    for value in ([high, low], [low], [low, low, high], *([] if meta["of_gripper"] else [[]])):
        assert "[low, high]" in refused(verb, name, value)
    for value in ([math.nan, high], [low, math.nan]):
        refused(verb, name, value)


@pytest.mark.parametrize(**selected(lambda meta, default: meta["of_gripper"]))
def test_what_is_left_out_is_left_to_the_gripper(verb, name, meta, default):
    validate(with_option(verb, name, [] if isinstance(default, list) else math.nan))


@pytest.mark.parametrize(**LISTS)
def test_lists_are_not_empty(verb, name, meta, default):
    refused(verb, name, [])


@pytest.mark.parametrize(**CHOICES)
def test_choices_are_closed(verb, name, meta, default):
    listed = isinstance(default, list)
    for choice in meta["choices"]:
        config = with_option(verb, name, [choice] if listed else choice)
        if name == "physics.device":
            config.physics.engine = "warp"  # the other engine knows one device
        if (name, choice) == ("randomise", "model"):
            config.model = "virtual_robot"  # without one there is none to draw from
        validate(config)
        for wrong in (choice.upper(), choice + "s", ""):
            message = refused(verb, name, [wrong] if listed else wrong)
            assert all(choice in message for choice in meta["choices"])


def test_observation_parts_come_once():
    assert "twice" in refused("train", "observation.parts", ["force", "position", "force"])


@pytest.mark.parametrize(
    ("verb", "name"), [(verb, name) for verb, name, *_ in LEAVES], ids=lambda value: value if "." in value else None
)
def test_misspelt_option_is_refused_with_the_right_name(verb, name):
    known = {known for known, *_ in leaves(SCHEMAS[verb])}
    swapped = [name[:i] + b + a + name[i + 2 :] for i, (a, b) in enumerate(pairwise(name))]
    for wrong in (f"{name}x", swapped[-1], swapped[0]):
        if wrong in known:
            continue
        with pytest.raises(ConfigError) as caught:
            compose(verb, [f"{wrong}=1"])
        message = str(caught.value)
        assert message.startswith(f"no option {wrong!r}")
        assert re.search(rf"(\?|mean|or|known:|,) ?{re.escape(name)}\b", message)


@pytest.mark.parametrize(
    "override",
    [
        "_target_=builtins.print",
        "+_target_=builtins.print",
        "++_target_=builtins.print",
        "ppo._target_=builtins.print",
        "+ppo._target_=builtins.print",
        "ppo={_target_: builtins.print}",
        "+ppo.hidden._target_=builtins.print",
        "ppo.hidden={_target_: builtins.print}",
        "ppo.hidden=[{_target_: builtins.print}]",
        "hydra.launcher._target_=builtins.print",
        "hydra.sweeper._target_=builtins.print",
        "hydra.callbacks={mine: {_target_: builtins.print}}",
        "+hydra.callbacks.mine._target_=builtins.print",
        "hydra.launcher={_target_: builtins.print}",
        "hydra.searchpath=[file:///tmp]",
        "hydra/callbacks=log_job_return",
        "hydra.callbacks={}",
        "hydra/sweeper=basic",
        "hydra.sweeper.params={seed: 1}",
        "hydra/job_logging=stdout",
        "hydra.job_logging.handlers.file.class=os.system",
        "hydra/launcher@hydra.callbacks=joblib",
        "hydra.launcher.pre_dispatch=print(1)",
        "hydra.launcher.setup=[ls]",
        "hydra.job.chdir=true",
        "hydra.output_subdir=x",
        "--config-dir=/tmp",
        "--config-path=/tmp",
    ],
)
def test_no_option_can_name_a_python_object(override):
    with pytest.raises(ConfigError):
        compose("train", [override])


@pytest.mark.parametrize("verb", [verb for verb in SCHEMAS if verb != "train"])
@pytest.mark.parametrize("override", ["hydra.run.dir=x", "hydra/launcher=joblib", "hydra.searchpath=[file:///tmp]"])
def test_verbs_that_hydra_does_not_run_have_no_options_of_its_own(verb, override):
    with pytest.raises(ConfigError, match="no option"):
        compose(verb, [override])


def test_what_a_training_takes_of_hydras_own_is_there():
    plain = ["hydra.run.dir=a", "hydra.sweep.dir=b", "hydra/launcher=joblib", "hydra.launcher.n_jobs=2"]
    assert compose_run("train", plain)[1] == "a"
    assert {"hydra.run.dir", "hydra.sweep.dir", "hydra.launcher.n_jobs"} < set(HYDRA_OPTIONS)


def test_options_of_slurm_are_the_launchers():
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher")  # of the extra cluster
    slurm = [f"{name}=3" for name in HYDRA_OPTIONS if "launcher" in name and "n_jobs" not in name]
    compose("train", ["hydra/launcher=submitit_slurm", *slurm])


def test_a_folder_may_be_named_anything(tmp_path):
    folder = str(tmp_path / "small_targets")
    assert compose_run("train", [f"hydra.run.dir={folder}"])[1] == folder


@pytest.mark.parametrize("value", ["1.5", "many", "true", "null", "[1]", "{a: 1}", ""])
def test_wrong_types_are_refused(value):
    with pytest.raises(ConfigError, match=r"ppo\.grasps"):
        compose("train", [f"ppo.grasps={value}"])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("ppo.hidden", "[[1]]"),
        ("ppo.hidden", "[{a: 1}]"),
        ("grasp.kappa", "[[0],[1]]"),
        ("observation.parts", "[[force]]"),
    ],
)
def test_lists_hold_no_lists(name, value):
    with pytest.raises(ConfigError, match=re.escape(name)):
        compose("train", [f"{name}={value}"])
