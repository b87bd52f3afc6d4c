"""Learning curves: which runs belong together, and that means and intervals are those of an independent computation."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image
from rich.console import Console
from scipy import stats

from forcegrasp.config import TrainConfig
from forcegrasp.errors import CheckpointError
from forcegrasp.evaluate.curve_figure import draw_curves
from forcegrasp.evaluate.curve_groups import CURVES, group_runs
from forcegrasp.evaluate.curves import learning_curves
from forcegrasp.runs.history import find_histories

REWARD = "episode/force_reward_normalised"


def write_run(path: Path, seed: int, rewards: list[float], total: int = 1000, command: str = "ib", **options) -> Path:
    """A run whose batches have 100 frames; ``options`` are dotted names with ``__``."""
    config = dataclasses.asdict(TrainConfig(seed=seed))
    config["ppo"]["total_frames"] = total
    for name, value in options.items():
        section, _, option = name.partition("__")
        config[section][option] = value
    path.mkdir(parents=True)
    (path / "config.yaml").write_text(yaml.safe_dump(config))
    if command:
        (path / "run.json").write_text(json.dumps({"command": ["forcegrasp", "train", f"experiment={command}"]}))
    with open(path / "metrics.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["frames", *(column for column, *_ in CURVES)])
        writer.writerows([100 * (i + 1), *(reward / k for k in (1, 2, 3, 4))] for i, reward in enumerate(rewards))
    return path


def report_of(*folders: Path, out: Path) -> tuple[dict, str]:
    said = io.StringIO()
    report = learning_curves(list(folders), out, Console(file=said, width=200))
    assert report == json.loads((out / "curves.json").read_text())
    return report, said.getvalue()


def line(seed: int) -> list[float]:
    return list(np.random.default_rng(seed).uniform(50, 100, 10))


def test_mean_and_t_interval_over_seeds(tmp_path):
    for seed in range(3):
        write_run(tmp_path / f"ib_{seed}", seed, line(seed))
    report, said = report_of(tmp_path, out=tmp_path)
    (group,) = report["groups"].values()
    assert group["averaged_seeds"] == [0, 1, 2]
    for column, divisor in zip((column for column, *_ in CURVES), (1, 2, 3, 4), strict=True):
        lines = np.array([line(seed) for seed in range(3)]) / divisor
        expected = stats.ttest_1samp(lines, 0).confidence_interval(0.95)
        at = np.arange(100, 1001, 100)
        for name, values in {"mean": lines.mean(0), "low": expected.low, "high": expected.high}.items():
            # the common frames lie between those of the batches, at which alone the interval is the expected one
            found = np.array(group["curves"][column][name], float)
            assert found[0] == pytest.approx(values[0], rel=1e-4)
            assert found[-1] == pytest.approx(values[-1], rel=1e-4)
            if name == "mean":
                np.testing.assert_allclose(found, np.interp(group["frames"], at, values), rtol=2e-3)
        # the last tenth of 1000 frames is the last batch
        end = group["end"][column]
        assert end["mean"] == pytest.approx(lines[:, -1].mean(), rel=1e-4)
        assert (end["low"], end["high"]) == pytest.approx((expected.low[-1], expected.high[-1]), rel=1e-4)
    assert f"{np.mean([line(seed)[-1] for seed in range(3)]):.1f}" in said


def test_one_seed_has_no_interval(tmp_path):
    write_run(tmp_path / "run", 0, line(0))
    report, said = report_of(tmp_path / "run", out=tmp_path / "out")
    curve = report["groups"]["ib"]["curves"][REWARD]
    assert set(curve["low"]) == set(curve["high"]) == {None}
    assert "±" not in said.split("trained with")[1]


def test_groups_differ_in_more_than_the_seed_and_are_named_after_it(tmp_path):
    write_run(tmp_path / "a", 0, line(0))
    write_run(tmp_path / "b", 1, line(1), physics__threads=3, log__keep=9)  # which change no result
    write_run(tmp_path / "c", 0, line(2), command="no_ib", action__inductive_bias=False)
    write_run(tmp_path / "deeper" / "d", 0, line(3), ppo__discount=0.9)
    write_run(tmp_path / "e", 0, line(3), command="", ppo__discount=0.5)
    report, _ = report_of(tmp_path, out=tmp_path)
    seeds = {label: group["averaged_seeds"] for label, group in report["groups"].items()}
    assert seeds == {"ib": [0, 1], "no_ib": [0], "ppo.discount=0.5": [0], "ib ppo.discount=0.9": [0]}


def test_what_all_runs_share_is_not_in_their_names(tmp_path):
    for name, bias in (("ib", True), ("no_ib", False)):
        write_run(
            tmp_path / name, 0, line(0), command=name, reward__form="goal_normalised", action__inductive_bias=bias
        )
    report, _ = report_of(tmp_path / "ib", tmp_path / "no_ib", tmp_path / "ib", out=tmp_path)
    assert list(report["groups"]) == ["ib", "no_ib"]


def test_unfinished_runs_are_named_and_spoil_no_mean(tmp_path):
    write_run(tmp_path / "done", 0, line(0))
    torn = write_run(tmp_path / "torn", 1, [0.0] * 4)
    with open(torn / "metrics.csv", "a") as file:
        file.write("500,9")  # as a run at work may leave it
    write_run(tmp_path / "other", 0, [3.0] * 2, command="no_ib", action__inductive_bias=False)
    silent = write_run(tmp_path / "silent", 2, [])
    report, said = report_of(tmp_path, out=tmp_path)
    assert report["groups"]["ib"]["averaged_seeds"] == [0]
    assert report["groups"]["ib"]["curves"][REWARD]["mean"][-1] == pytest.approx(line(0)[-1], rel=1e-4)
    other = report["groups"]["no_ib"]
    assert other["end"][REWARD]["mean"] == 3
    assert other["curves"][REWARD]["mean"][-1] is None  # drawn as far as it got
    assert f"{torn} unfinished: 400 of 1,000 frames" in said
    assert f"{silent} has not finished a batch yet" in said
    assert "(unfinished)" in said


def test_of_twins_the_longer_one_counts(tmp_path):
    short = write_run(tmp_path / "a", 0, line(0)[:5])
    write_run(tmp_path / "b", 0, line(0))
    report, said = report_of(tmp_path, out=tmp_path)
    assert [run["frames"] for run in report["groups"]["ib"]["runs"]] == [1000]
    assert f"{short} left out: same configuration and seed" in said


def test_figure_shows_a_line_per_group_and_a_band_where_there_are_seeds(tmp_path):
    for seed in range(2):
        write_run(tmp_path / f"ib{seed}", seed, line(seed))
    write_run(tmp_path / "no_ib", 0, line(5), command="no_ib", action__inductive_bias=False)
    runs, _ = find_histories([tmp_path], [column for column, *_ in CURVES])
    figure = draw_curves(group_runs(runs)[0], np.linspace(100, 1000, 50))
    for axes in figure.axes:
        assert len(axes.lines) == 3 + 2 + 1  # runs, means, end of the curriculum
        assert len(axes.collections) == 1  # the band of the two seeds
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["ib (2 seeds)", "no_ib (1 seed)"]
    figure.savefig(tmp_path / "curves.png")
    with Image.open(tmp_path / "curves.png") as picture:
        assert len(set(picture.convert("L").tobytes())) > 50


def test_a_dollar_in_a_name_is_no_mathematics(tmp_path):
    write_run(tmp_path / "run", 0, line(0), command="a$b_{$c")
    report, _ = report_of(tmp_path, out=tmp_path)
    assert list(report["groups"]) == ["a$b_{$c"]
    assert (tmp_path / "curves.png").is_file()


def test_runs_that_a_training_wrote_can_be_drawn(tmp_path):
    from forcegrasp.runs.run_dir import RunDir

    run = RunDir.create(tmp_path / "run", TrainConfig(), ["experiment=recommended"])
    run.log_metrics({"frames": 5_000_000, **{column: 1.5 for column, *_ in CURVES}})
    report, _ = report_of(tmp_path, out=tmp_path)
    assert report["groups"]["recommended"]["end"][REWARD]["mean"] == 1.5


def test_a_configuration_without_a_seed_is_refused(tmp_path):
    run = write_run(tmp_path / "run", 0, line(0))
    (run / "config.yaml").write_text("seed: many\n")
    with pytest.raises(CheckpointError, match="seed and ppo"):
        learning_curves([tmp_path], tmp_path)
