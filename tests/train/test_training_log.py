"""What a training shows: TensorBoard, metrics.csv and figures, and that their numbers are what they say."""

from __future__ import annotations

import io
import re
import threading
import time
import warnings

import numpy as np
import pytest
from PIL import Image
from tensorboard.plugins.custom_scalar import layout_pb2

from forcegrasp.env.episodes import METRICS
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.algorithms import PPO
from forcegrasp.train.board import CHARTS, OVERVIEW, tag
from forcegrasp.train.logging import TrainingLog
from forcegrasp.train.loop import _progress, train


def events(run: RunDir):
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        everything = dict.fromkeys(("scalars", "histograms", "images", "tensors"), 0)
        return EventAccumulator(str(run.tensorboard), size_guidance=everything).Reload()


@pytest.fixture(scope="module")
def config(tiny):
    # long enough that the object is touched and moved
    sections = {"grasp": {"steps": 50}, "ppo": {"total_frames": 500}, "curriculum": {"end_fraction": 0.5}}
    weights = {"reward": {"force_weight": 1.5, "object_weight": 0.7, "action_weight": 0.3}}
    return tiny(**sections, **weights, log={"histograms_every": 2, "figures_every": 2, "video_every": 3})


@pytest.fixture(scope="module")
def gif() -> bytes:
    data = io.BytesIO()
    Image.new("P", (2, 2)).save(data, "GIF")
    return data.getvalue()


@pytest.fixture(scope="module")
def run(config, gif, tmp_path_factory, trained):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("forcegrasp.train.logging.grasp_video", lambda *args, **kwargs: gif)
        return trained(tmp_path_factory.mktemp("log") / "run", config)


def test_tensorboard_shows_every_group(run):
    found = events(run)
    tags = found.Tags()
    shown = ["1_overview", "2_episode", "3_reward", "4_ppo", "5_curriculum", "6_speed"]
    assert sorted({tag.split("/")[0] for tag in tags["scalars"]}) == shown
    assert set(tags["histograms"]) == {"actions/policy", "forces/touching_n"}
    assert set(tags["images"]) == {"grasps/force_traces", "grasps/video"}
    assert {"1_about_this_run/text_summary", "2_config/text_summary"} <= set(tags["tensors"])
    expected = {
        "episode/return",
        "episode/force_reward_normalised",
        "episode/force_reward_paper",
        "episode/displacement_until_grasped_mm",
        "reward/force_paper",
        "reward/force_normalised",
        "reward/object",
        "reward/action",
        "ppo/loss_objective",
        "ppo/loss_critic",
        "ppo/kl_approx",
        "ppo/clip_fraction",
        "ppo/learning_rate",
        "ppo/entropy",
        "curriculum/object_weight",
        "curriculum/speed_threshold_m",
        "speed/frames_per_s",
    }
    assert {tag(column) for column in expected} <= set(tags["scalars"])


def test_what_matters_comes_first(run):
    first = sorted(events(run).Tags()["scalars"])[: len(OVERVIEW)]
    assert first == [tag(column) for column in OVERVIEW]


def test_every_chart_of_the_layout_shows_what_is_logged(run):
    found = events(run)
    (event,) = found.Tensors("custom_scalars__config__")
    pages = layout_pb2.Layout.FromString(event.tensor_proto.string_val[0]).category
    learning, pushing, *others = CHARTS
    assert [page.title for page in pages] == [learning, pushing, *PPO.CHARTS, *others]
    for page in pages:
        for chart in page.chart:
            for pattern in chart.multiline.tag:
                assert len([name for name in found.Tags()["scalars"] if re.match(pattern, name)]) == 1, pattern


def test_the_card_tells_how_to_go_on_and_what_the_names_mean(run, config):
    (event,) = events(run).Tensors("1_about_this_run/text_summary")
    text = event.tensor_proto.string_val[0].decode()
    assert text.startswith(f"# ib, seed {config.seed}\n")
    assert f"resume={run.path}" in text
    for name in METRICS:
        assert f"`{name}`" in text


def test_metrics_are_tensorboards(run, metrics):
    found, rows = events(run), metrics(run)
    columns = [column for column in rows[0] if column != "frames"]
    scalars = {name for name in found.Tags()["scalars"] if not name.startswith("6_speed/")}
    assert {tag(column) for column in columns} == scalars
    for column in columns:
        logged = [(event.step, event.value) for event in found.Scalars(tag(column))]
        assert [step for step, _ in logged] == [row["frames"] for row in rows]
        np.testing.assert_allclose([value for _, value in logged], [row[column] for row in rows], rtol=1e-6)


def test_parts_appear_as_often_as_asked(run):
    found = events(run)
    assert [event.step for event in found.Histograms("actions/policy")] == [200, 400]
    # and at the end
    assert [event.step for event in found.Images("grasps/force_traces")] == [200, 400, 500]
    assert [event.step for event in found.Images("grasps/video")] == [300, 500]
    assert sorted(path.name for path in run.figures.iterdir()) == [
        "grasp_000000000300.gif",
        "grasp_000000000500.gif",
        "traces_000000000200.png",
        "traces_000000000400.png",
        "traces_000000000500.png",
    ]
    for path in run.figures.glob("*.png"):
        with Image.open(path) as picture:
            assert len(set(picture.convert("L").tobytes())) > 10


def test_histogram_of_actions_is_what_the_gripper_gets(run):
    histogram = events(run).Histograms("actions/policy")[0].histogram_value
    assert histogram.num == 2 * 50 * 2
    assert histogram.min >= -1
    assert histogram.max <= 1


def test_schedules_in_the_metrics(run, metrics, config):
    rows = metrics(run)
    before = np.array([0, 100, 200, 300, 400])
    assert [row["frames"] for row in rows] == list(before + 100)
    rate = config.ppo.learning_rate * np.interp(before, [0, 500], [1, config.ppo.learning_rate_end])
    np.testing.assert_allclose([row["ppo/learning_rate"] for row in rows], rate, rtol=1e-9)
    weight = np.interp(before, [0, 250], [config.curriculum.object_weight, config.reward.object_weight])
    np.testing.assert_allclose([row["curriculum/object_weight"] for row in rows], weight, rtol=1e-9)
    low = np.interp(before, [0, 250], [config.curriculum.offset_m[0], config.grasp.offset_m[0]])
    np.testing.assert_allclose([row["curriculum/offset_low_m"] for row in rows], low, rtol=1e-9)


def test_returns_are_the_sum_of_the_reward_terms(run, metrics, config):
    rows = metrics(run)
    assert any(row["reward/object"] < 0 for row in rows), "the object must have moved"
    assert all(row["reward/action"] < 0 for row in rows)
    for row in rows:
        step = (
            config.reward.force_weight * row["reward/force_paper"]
            + row["curriculum/object_weight"] * row["reward/object"]
            + config.reward.action_weight * row["reward/action"]
        )
        assert row["episode/return"] == pytest.approx(config.grasp.steps * step, rel=1e-4)
        assert row["episode/force_reward_paper"] == pytest.approx(50 * row["reward/force_paper"], rel=1e-4)
        assert row["episode/fast_steps"] == pytest.approx(-50 * row["reward/object"], rel=1e-4)


def test_progress_shows_no_number_before_there_is_one(capsys):
    figures = {"force_reward_normalised": 74.6, "displacement_until_grasped_mm": 0.123}
    with _progress(1000, 0, 150):
        pass
    before = capsys.readouterr().out
    assert "0 % of 1,000 frames" in before
    assert "nan" not in before
    assert "force reward" not in before
    with _progress(1000, 0, 150) as progress:
        progress(500, figures)
    assert "50 % of 1,000 frames force reward 75/150 moved 0.12 mm" in capsys.readouterr().out


def test_a_full_disk_is_not_told_by_tensorboards_thread(tiny, tmp_path, monkeypatch):
    """The batch that follows tells it in one line; a traceback of the thread would only hide that."""
    told = []
    monkeypatch.setattr(threading, "excepthook", lambda facts: told.append(facts.exc_type))

    def fail_with(error: Exception) -> None:
        def work():
            raise error

        thread = threading.Thread(target=work)
        thread.start()
        thread.join()

    run = RunDir.create(tmp_path / "run", config := tiny(), [])
    with TrainingLog(run, config, 0):
        fail_with(OSError(28, "No space left on device"))
        fail_with(ZeroDivisionError())
    fail_with(OSError(28, "No space left on device"))
    assert told == [ZeroDivisionError, OSError]


def test_a_resumed_run_hides_what_it_repeats(tiny, tmp_path):
    config = tiny(log={"checkpoint_every": 2})
    run = RunDir.create(tmp_path / "run", config, [])
    log = TrainingLog.batch

    def batch(self, number, *args):
        log(self, number, *args)
        if number == 3:
            raise ZeroDivisionError

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TrainingLog, "batch", batch)
        with pytest.raises(ZeroDivisionError):
            train(config, run)
    # TensorBoard reads event files in the order of their names, which begin with the second they were opened in;
    # no run is stopped and resumed within one.
    time.sleep(1.1)
    assert train(config, run, resume=True)
    assert [event.step for event in events(run).Scalars(tag("episode/return"))] == [60, 120, 180, 240, 300]
