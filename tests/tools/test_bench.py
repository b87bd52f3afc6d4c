"""The benchmark runs, and its peers simulate the same problem."""

from __future__ import annotations

import json

import numpy as np
import pytest

from forcegrasp.config import PhysicsConfig, SensorConfig, TrainConfig
from forcegrasp.env.gymnasium_view import GraspGymnasiumEnv
from tools import json_lines
from tools.bench import history, learning
from tools.bench.__main__ import main
from tools.bench.case import STEPS, Case, Learning, Measured
from tools.bench.levels import BATCHES, LEVELS
from tools.bench.peers import PEERS, missing
from tools.bench.plain_grasp import PlainGrasp
from tools.bench.results import Results
from tools.bench.turns import measure


@pytest.mark.parametrize("form", ["paper", "goal_normalised"])
def test_plain_grasp_is_the_same_problem(form):
    config = TrainConfig(physics=PhysicsConfig("fast", 1), sensors=SensorConfig(0.0, 0.0, 0.05))
    config.reward.form = form
    view = GraspGymnasiumEnv(physics=config.physics, sensors=config.sensors, reward=config.reward)
    plain = PlainGrasp(config)
    observation, _ = view.reset(seed=3)
    # the view spreads a seed over its parts
    seen, _ = plain.reset(seed=int(np.random.SeedSequence(3).generate_state(2)[0]))
    np.testing.assert_allclose(seen, observation, atol=1e-6)
    total, touched = 0.0, np.zeros(2)
    for action in np.random.default_rng(0).uniform(-1.2, 0.2, (STEPS, 2)).astype(np.float32):
        observation, reward, _, truncated, info = view.step(action)
        seen, got, _, ended, told = plain.step(action)
        # commands are rounded to single precision in one of them
        np.testing.assert_allclose(seen, observation, atol=2e-3)
        assert got == pytest.approx(reward, abs=2e-3)
        assert ended == truncated
        total, touched = total + info["reward_terms.force_normalised"][0], info["had_contact"]
    assert ended
    assert told["force_reward"] == pytest.approx(total, abs=0.05)
    assert touched.all(), "the trial must reach both fingers' phase"


@pytest.mark.parametrize("name", LEVELS)
def test_levels_count_their_steps(name):
    batches = BATCHES if name == "training" else 1
    assert LEVELS[name](Case(name, "fast", 2, 1))() == 2 * STEPS * batches


def test_program_measures_draws_and_reads_again(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("tools.bench.__main__.usable_cores", lambda: 1)
    out, picture = tmp_path / "speed.json", tmp_path / "speed.png"
    small = ("--only", "simulator", "--grasps", "4", "--tiers", "fast", "--repeats", "1", "--seconds", "0")
    assert main([*small, "--scale", "2", "--json", str(out), "--figure", str(picture)]) == 0
    assert "What each layer costs" in capsys.readouterr().out
    found = json.loads(out.read_text())
    assert found["levels"][0]["steps_per_second"] > 0
    assert [one["case"]["grasps"] for one in found["by_grasps"]] == [2]
    assert found["by_threads"][0]["case"]["threads"] == 1
    size = picture.stat().st_size
    picture.unlink()
    assert main(["--from", str(out), "--figure", str(picture)]) == 0
    assert picture.stat().st_size == size


def test_what_was_learned_is_told_and_drawn(tmp_path, capsys):
    rates = {"training": 9000.0, "SB3 training, plain": 300.0}
    ours = [
        Measured(Case("training", tier, 256), rates["training"] / k, 9.0) for k, tier in ((1, "fast"), (3, "reference"))
    ]
    peer = Measured(Case("SB3 training, plain", "reference", 10, 1), 300.0, 9.0)
    quick = Learning("forcegrasp", "fast", [(1.0, 10, 20.0), (2.0, 20, 101.0)], 100.0, 60.0)
    slow = Learning("SB3", "reference", [(50.0, 5, 30.0)], 100.0, 60.0)
    stuck = Learning("SB3", "reference", [], 100.0, 60.0)
    results = Results(10, ours, [peer], learning=[quick, slow, stuck], machine={"cores": 2})
    results.write(tmp_path / "all.json")
    assert Results.read(tmp_path / "all.json") == results
    assert main(["--from", str(tmp_path / "all.json"), "--figure", str(tmp_path / "all.png")]) == 0
    said = capsys.readouterr().out
    assert "not in 60 s, best 30.0" in said
    assert "more than 30.0 times as long" in said
    assert {"30.0", "10.0", "3.0"} <= set(said.replace("│", " ").split())  # of it stack, of it tier
    assert (tmp_path / "all_learning.png").exists()


def measured(collection: float, grasps: int = 256) -> Results:
    rates = {"raw engine": 1000.0, "collection": 1000.0 * collection}
    levels = [Measured(Case(name, "fast", grasps), rate, 9.0) for name, rate in rates.items()]
    return Results(10, levels, machine={"cores": 2})


def test_a_history_of_ratios_tells_what_became_slower(tmp_path, monkeypatch, capsys):
    kept, source = tmp_path / "history.jsonl", tmp_path / "one.json"
    assert main(["--check", str(kept)]) == 0  # nothing was measured yet
    for commit, ratio, machine in (("a" * 40, 0.8, 2), ("b" * 40, 0.5, 64), ("c" * 40, 0.73, 2), ("d" * 40, 0.65, 2)):
        monkeypatch.setattr(history, "git_hash", lambda commit=commit: commit)
        results = measured(ratio)
        results.machine["cores"] = machine
        results.write(source)
        assert main(["--from", str(source), "--history", str(kept)]) == 0
        slower = main(["--check", str(kept)])
        assert slower == (commit[0] == "d"), commit  # by 11 %, on one machine; on another it says nothing
    said = " ".join(capsys.readouterr().out.split())
    assert "collection, fast: 0.65 of the raw engine, 0.73 at cccccccccccc" in said
    assert (tmp_path / "history.png").exists()
    assert json_lines.read(kept)[0]["ratios"] == {"collection, fast": 0.8}


def test_another_size_and_the_same_commit_are_not_held_against_a_run(tmp_path, monkeypatch):
    monkeypatch.setattr(history, "git_hash", lambda: "a" * 40)
    entries = [history.entry(measured(ratio)) for ratio in (0.9, 0.5)]
    assert history.lost(entries) == []
    monkeypatch.setattr(history, "git_hash", lambda: "b" * 40)
    assert history.lost([*entries, history.entry(measured(0.3, 16))]) == []
    assert history.lost([*entries, history.entry(measured(0.3))]) != []
    without_engine = Results(10, measured(0.5).levels[1:])
    assert history.entry(without_engine) is None


def test_our_training_tells_of_each_batch(monkeypatch):
    config = learning.tuned("fast")
    config.ppo.grasps, config.ppo.total_frames = 2, 3 * STEPS
    monkeypatch.setattr(learning, "tuned", lambda tier: config)
    told = []
    learning.ours("fast", 1, lambda frames, reward: told.append((frames, reward)))
    assert [frames for frames, _ in told] == [2 * STEPS, 4 * STEPS]
    assert all(0 < reward < STEPS for _, reward in told)


@pytest.mark.parametrize("name", ["gymnasium Async, plain", "SB3 training, plain"])
def test_peers_simulate_in_processes_that_end(name):
    if module := missing(name):
        pytest.skip(f"needs {module}")
    (found,) = measure([Case(name, "fast", 2, 1)], repeats=1, seconds=0, say=lambda _: None)
    assert found.steps_per_second > 0


def test_a_case_that_fails_says_why():
    with pytest.raises(RuntimeError, match=r"simulator \(none, 1 grasps\) failed: .*none"):
        measure([Case("simulator", "none", 1)], repeats=1, seconds=0, say=lambda _: None)


def test_what_is_not_installed_is_left_out(monkeypatch, capsys):
    monkeypatch.setattr("tools.bench.peers.find_spec", lambda name: None)
    assert [name for name in PEERS if missing(name)] == [name for name in PEERS if name.startswith("SB3")]
    assert main(["--only", "SB3 training, plain"]) == 0
    assert "left out: SB3 training, plain, which needs stable_baselines3" in capsys.readouterr().out
