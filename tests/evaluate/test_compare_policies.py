"""The comparison of policies: its files agree with each other, and a run is evaluated as it was trained."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from rich.console import Console

from forcegrasp.config import ActionConfig, EvaluateConfig, GraspConfig, PhysicsConfig, TrainConfig, validate
from forcegrasp.env.episodes import METRICS, summarise
from forcegrasp.errors import CheckpointError, ConfigError
from forcegrasp.evaluate.compare_policies import evaluate
from forcegrasp.evaluate.grids import kappa_grid
from forcegrasp.evaluate.policies import load_policies
from forcegrasp.evaluate.rollouts import roll_out
from forcegrasp.policies import shipped_policies
from forcegrasp.runs.policy import load_policy
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.loop import Trainer

FAST = PhysicsConfig(tier="fast", threads=1)
STEPS = 60


def evaluate_config(**options) -> EvaluateConfig:
    defaults = {"kappas": 3, "trials": 4, "physics": FAST, "grasp": GraspConfig(steps=STEPS), "seed": 5}
    config = EvaluateConfig(**defaults | options)
    validate(config)
    return config


def untrained_run(path: Path, **sections) -> tuple[RunDir, Trainer]:
    """A run whose policy has random weights, large enough to tell observations apart."""
    config = TrainConfig()
    for section, values in sections.items():
        for name, value in values.items():
            assert hasattr(getattr(config, section), name)
            setattr(getattr(config, section), name, value)
    config.ppo.hidden, config.ppo.grasps, config.ppo.initial_action = [8], 2, -0.7
    validate(config)
    trainer = Trainer(config)
    trainer.env.reset()
    with torch.no_grad():
        for parameter in trainer.policy.parameters():
            parameter += 0.05 * torch.randn_like(parameter)
    run = RunDir.create(path, config, [])
    run.save(1, *trainer.state(), keep=1)
    return run, trainer


@pytest.fixture
def undrawn(monkeypatch) -> None:
    """Leaves out the drawing, which takes most of the time."""
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda *args, **kwargs: None)
    monkeypatch.setattr("forcegrasp.reports.html._svg", lambda figure: "")


@pytest.fixture(scope="module")
def compared(tmp_path_factory) -> tuple[dict, Path, str]:
    """Two controllers compared: the report, its folder, and what was printed."""
    out, console = tmp_path_factory.mktemp("out") / "deep" / "er", Console(file=io.StringIO(), width=80)
    report = evaluate(evaluate_config(policies=["force_pi", "close"]), out, console)
    return report, out, console.file.getvalue()


@pytest.fixture(scope="module")
def trials(compared) -> list[dict]:
    with open(compared[1] / "trials.csv", newline="") as file:
        return [
            {key: value if key in ("policy", "cell") else float(value) for key, value in row.items()}
            for row in csv.DictReader(file)
        ]


def test_files(compared):
    _, out, _ = compared
    names = {"evaluation.json", "tables.md", "trials.csv", "force_reward.png", "displacement.png", "report.html"}
    names.add("overshoot.png")
    assert {path.name for path in out.iterdir()} == names | {"traces_force_pi.png", "traces_close.png"}
    for path in out.glob("*.png"):
        with Image.open(path) as picture:
            assert min(picture.size) > 300
            colours = picture.convert("RGB").getcolors(1 << 24)
        assert len(colours) > 50, f"{path.name} is blank"


def test_report_is_what_was_written(compared):
    report, out, _ = compared
    assert json.loads((out / "evaluation.json").read_text()) == report
    assert report["cells"] == ["0", "0.5", "1"]
    assert list(report["policies"]) == ["force_pi", "close"]
    assert (report["seed"], report["trials"], report["physics"]) == (5, 4, "fast")
    assert all(set(METRICS) == set(figures) for figures in report["policies"].values())


def test_one_row_per_trial_and_the_same_grasps_for_both(trials):
    columns = ("kappa", "b2", "radius_m", "offset_m", "goal_force_n")
    grasps = {
        name: [[row[column] for column in columns] for row in trials if row["policy"] == name]
        for name in ("force_pi", "close")
    }
    assert len(trials) == 2 * 3 * 4
    assert grasps["force_pi"] == grasps["close"]
    expected = kappa_grid(GraspConfig(steps=STEPS), 3, 4, seed=5).grasps.as_array()
    np.testing.assert_allclose(grasps["close"], expected, rtol=1e-8)


@pytest.mark.parametrize("figure", METRICS)
def test_means_follow_from_the_trials(compared, trials, figure):
    for name, figures in compared[0]["policies"].items():
        values = np.array([row[figure] for row in trials if row["policy"] == name])
        summary = figures[figure]
        assert summary["mean"] == pytest.approx(values.mean(), rel=1e-5, abs=1e-9)
        assert summary["std"] == pytest.approx(values.std(ddof=1), rel=1e-4, abs=1e-9)
        for cell, part in zip(compared[0]["cells"], summary["by_cell"], strict=True):
            own = [row[figure] for row in trials if row["policy"] == name and row["cell"] == cell]
            assert len(own) == 4
            assert part["mean"] == pytest.approx(np.mean(own), rel=1e-5, abs=1e-9)


def test_intervals_hold_the_mean_and_shrink(compared):
    for figures in compared[0]["policies"].values():
        for figure in figures.values():
            for part in (figure, *figure["by_cell"]):
                assert part["low"] - 1e-9 <= part["mean"] <= part["high"] + 1e-9
                # a 95 % interval of a mean spans about four standard errors
                assert part["high"] - part["low"] <= 6 * part["std"] / 2 + 1e-9


def test_table_shows_the_means(compared):
    report, out, printed = compared
    assert "force_pi" in printed
    assert str(out) in printed.replace("\n", "")
    assert f"{report['policies']['force_pi']['force_reward_normalised']['mean']:.1f}" in printed


def test_trials_are_the_rollouts_own_figures(compared, trials):
    evaluated = load_policies(["force_pi"])[0]
    config = evaluate_config()
    grasps = kappa_grid(config.grasp, 3, 4, 5).grasps
    episodes = roll_out(evaluated.policy, grasps, config.grasp, 5, physics=FAST, action=evaluated.action)
    for figure, values in summarise(episodes, config.sensors).items():
        written = [row[figure] for row in trials if row["policy"] == "force_pi"]
        np.testing.assert_allclose(written, values, rtol=1e-5, atol=1e-9)


SECTIONS = {
    "ib": {},
    "no_ib": {"action": {"inductive_bias": False}},
    "small steps": {"action": {"max_delta_m": 0.002, "bias_one_contact": 0.0}},
    "one frame": {"observation": {"frames": 1}},
    "few parts": {"observation": {"parts": ["force_error", "position"]}, "ppo": {"mirrored": False}},
    "blind critic": {"ppo": {"critic": "observation"}},
}


@pytest.mark.parametrize("name", SECTIONS)
def test_run_is_evaluated_as_it_was_trained(name, tmp_path, undrawn):
    run, trainer = untrained_run(tmp_path / "run", **SECTIONS[name])
    config = evaluate_config(policies=[str(run.path)], kappas=2, trials=2)
    report = evaluate(config, tmp_path / "out", Console(file=io.StringIO()))
    trained_with = trainer.config
    grasps = kappa_grid(config.grasp, 2, 2, config.seed).grasps
    episodes = roll_out(
        trainer.policy,
        grasps,
        config.grasp,
        config.seed,
        physics=FAST,
        action=trained_with.action,
        observation=trained_with.observation,
    )
    assert episodes["next", "force"].any()
    for figure, values in summarise(episodes, config.sensors).items():
        assert report["policies"]["run"][figure]["mean"] == pytest.approx(float(values.double().mean()), rel=1e-6)


def test_bias_and_step_size_of_the_run_matter(tmp_path, undrawn):
    found = set()
    for name in ("ib", "no_ib", "small steps"):
        torch.manual_seed(0)
        run, _ = untrained_run(tmp_path / name.replace(" ", "_"), **SECTIONS[name])
        config = evaluate_config(policies=[str(run.path)], kappas=1, trials=2)
        report = evaluate(config, tmp_path / "out", Console(file=io.StringIO()))
        found.add(report["policies"][run.path.name]["force_reward_normalised"]["mean"])
    assert len(found) == 3


def test_loaded_policy_is_the_trained_one(tmp_path):
    run, trainer = untrained_run(tmp_path / "run")
    policy, config = load_policy(run.path)
    assert config == trainer.config
    mine, loaded = trainer.policy.state_dict(), policy.state_dict()
    assert mine.keys() == loaded.keys()
    assert all(torch.equal(mine[key], loaded[key]) for key in mine)
    assert not policy.training


def test_controllers_act_without_bias():
    for evaluated in load_policies(["force_pi", "informed", "close", "nothing"]):
        assert evaluated.action == ActionConfig(inductive_bias=False)


def test_names_of_policies(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    untrained_run(tmp_path / "mine")
    assert [c.name for c in load_policies(["./mine", "close"])] == ["mine", "close"]
    with pytest.raises(ConfigError, match="mine is named twice"):
        load_policies(["mine", "./mine/"])
    with pytest.raises(ConfigError, match="did you mean force_pi"):
        load_policies(["force_p"])
    with pytest.raises(CheckpointError, match="no such run directory"):
        load_policies(["runs/nowhere"])


def test_runs_of_one_name_in_two_folders_are_compared(tmp_path):
    # such as the seeds of two sweeps, whose folders are named alike
    for folder in ("one", "two"):
        untrained_run(tmp_path / folder / "ib_s0")
    names = [c.name for c in load_policies([str(tmp_path / "one" / "ib_s0"), str(tmp_path / "two" / "ib_s0")])]
    assert len(set(names)) == 2


def test_all_runs_of_a_sweep(tmp_path):
    for run in ("sweep/ib_s2_1", "sweep/ib_s1_0", "other/ib_s3"):
        untrained_run(tmp_path / run)
    (tmp_path / "sweep" / "curves").mkdir()
    names = [c.name for c in load_policies([f"{tmp_path}/sweep/*", "force_pi"])]
    assert names == ["ib_s1_0", "ib_s2_1", "force_pi"]
    with pytest.raises(ConfigError, match="named twice"):
        load_policies([f"{tmp_path}/sweep/*", f"{tmp_path}/sweep/ib_s1_0"])
    with pytest.raises(ConfigError, match="there is no run in"):
        load_policies([f"{tmp_path}/sweep/curves/*"])


def test_the_baseline_is_what_the_others_are_held_against(compared, tmp_path, undrawn):
    report, _, printed = compared
    better = report["policies"]["close"]["force_reward_normalised"]["improvement"]
    assert better["low"] <= better["probability"] <= better["high"]
    assert better["probability"] < 0.5
    assert "improvement" not in report["policies"]["force_pi"]["force_reward_normalised"]
    assert "Baseline: force_pi" in printed
    config = evaluate_config(policies=["force_pi", "close"], baseline="close", kappas=1, trials=2)
    other = evaluate(config, tmp_path / "out", Console(file=io.StringIO()))
    assert "improvement" in other["policies"]["force_pi"]["force_reward_normalised"]


def test_the_baseline_is_beaten_by_more_reward_and_by_less_movement(compared):
    """Each figure counts in its own direction: close holds forces worse and moves the object more."""
    report, _, _ = compared
    other, base = report["policies"]["close"], report["policies"]["force_pi"]
    for figure in ("force_reward_normalised", "force_reward_paper", "force_reward_measured"):
        assert other[figure]["mean"] < base[figure]["mean"]
        assert other[figure]["improvement"]["probability"] < 0.5, figure
    for figure in ("displacement_total_mm", "overshoot_percent", "final_force_error_n"):
        assert other[figure]["mean"] > base[figure]["mean"]
        assert other[figure]["improvement"]["probability"] < 0.5, figure


def test_objects_in_place_of_softness_values(tmp_path, undrawn):
    config = evaluate_config(policies=["force_pi", "close"], objects="paper", trials=2)
    report = evaluate(config, tmp_path / "out", Console(file=io.StringIO(), width=200))
    assert report["cells"] == ["rubber_mat", "sponge", "spray", "pringles", "wood", "mug"]
    assert report["what"] == "object"
    text = (tmp_path / "out" / "tables.md").read_text()
    assert "| method | rubber_mat | sponge | spray | pringles | wood | mug | average |" in text
    mug = report["policies"]["close"]["force_reward_measured"]["by_cell"][-1]
    assert f"{mug['mean']:.1f} ± {mug['std']:.1f}" in text


@pytest.mark.parametrize("name", shipped_policies())
def test_shipped_policies_work_by_name(name):
    evaluated = load_policies([name])[0]
    assert evaluated.name == name
    grid = kappa_grid(GraspConfig(steps=STEPS), 1, 2, seed=0)
    episodes = roll_out(
        evaluated.policy,
        grid.grasps,
        GraspConfig(steps=STEPS),
        physics=FAST,
        action=evaluated.action,
        observation=evaluated.observation,
    )
    assert episodes["next", "force"].any()


def test_recommended_is_gentle_and_ib_is_not(tmp_path, undrawn):
    """Who crushes: docs/results.md has 0.1 % and 41 % of 2,200 grasps."""
    grasp = GraspConfig(steps=100)
    config = evaluate_config(policies=["recommended", "ib", "force_pi"], kappas=3, trials=12, grasp=grasp)
    found = evaluate(config, tmp_path / "out", Console(file=io.StringIO()))["policies"]
    crushed, beyond, moved, reward = (
        {name: metrics[metric]["mean"] for name, metrics in found.items()}
        for metric in ("crushed_percent", "overshoot_n", "displacement_total_mm", "force_reward_normalised")
    )
    assert crushed["recommended"] <= 100 / 36 < 15 < crushed["ib"]
    assert beyond["recommended"] < 0.5 * beyond["ib"]
    assert moved["recommended"] < moved["ib"]
    assert reward["force_pi"] + 5 < reward["recommended"]


@pytest.mark.long
def test_many_policies_and_one_softness(tmp_path):
    config = evaluate_config(policies=["force_pi", "informed", "close", "nothing"], kappas=1, trials=2)
    report = evaluate(config, tmp_path / "out", Console(file=io.StringIO()))
    assert len(report["policies"]) == 4
    assert report["policies"]["nothing"]["displacement_total_mm"]["mean"] < 0.01


def test_informed_beats_force_pi_beats_doing_nothing(tmp_path, undrawn):
    config = evaluate_config(
        policies=["informed", "force_pi", "nothing"], kappas=2, trials=4, grasp=GraspConfig(steps=100)
    )
    report = evaluate(config, tmp_path / "out", Console(file=io.StringIO()))
    means = [figures["force_reward_normalised"]["mean"] for figures in report["policies"].values()]
    assert means == sorted(means, reverse=True)
