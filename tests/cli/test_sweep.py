"""Sweeps: every combination becomes a run, the same as if it had been started alone."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import yaml
from joblib.externals.loky import get_reusable_executor

from forcegrasp.cli.main import main
from forcegrasp.cli.one_training import begin_or_resume
from forcegrasp.cli.options import compose
from forcegrasp.cli.resumed_sweep import typed_again
from forcegrasp.errors import CheckpointError
from forcegrasp.runs.lock import only_writer
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.logging import TrainingLog

MODEL = Path(__file__).parents[1] / "config" / "model.yaml"


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", sys.argv)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")
    return tmp_path


@pytest.fixture
def undrawn(monkeypatch) -> None:
    """Leaves out the learning curves, which take longer than these trainings."""
    monkeypatch.setattr("forcegrasp.cli.sweep._draw_curves", lambda folder: None)


def runs_in(folder: Path) -> dict[tuple[bool, int], RunDir]:
    """(bias, seed) → run."""
    found = {}
    for path in sorted(folder.rglob("config.yaml")):
        config = yaml.safe_load(path.read_text())
        found[config["action"]["inductive_bias"], config["seed"]] = RunDir(path.parent)
    return found


def final(run: RunDir) -> bytes:
    return max(run.checkpoints.iterdir()).read_bytes()


@pytest.mark.long
def test_two_experiments_and_two_seeds_side_by_side(tiny, tmp_path, capfd):
    """In two processes of joblib's, which know from here what names a run: experiment, model and seed."""
    Path("far").mkdir()
    shutil.copy(MODEL, "far/lag.yaml")
    options = [*tiny["train"], "model=far/lag.yaml"]
    swept = ["sweep=ablation", "experiment=ib,no_ib", "seed=0,1", "hydra.sweep.dir=sweep"]
    side_by_side = ["hydra/launcher=joblib", "hydra.launcher.n_jobs=2"]
    try:
        assert main(["train", "-m", *swept, *options, *side_by_side]) == 0
    finally:
        get_reusable_executor().shutdown()
    out, err = capfd.readouterr()
    assert "Traceback" not in err
    assert "learning curves are in sweep/curves.png" in out
    runs = runs_in(tmp_path / "sweep")
    assert set(runs) == {(True, 0), (True, 1), (False, 0), (False, 1)}
    names = ["ib_lag_s0_0", "ib_lag_s1_2", "no_ib_lag_s0_1", "no_ib_lag_s1_3"]
    assert sorted(run.path.name for run in runs.values()) == names
    assert len({final(run) for run in runs.values()}) == 4
    # a process of the sweep trains several runs: the last one is as good as the first
    assert main(["train", "experiment=no_ib", "seed=1", *options, "hydra.run.dir=alone"]) == 0
    assert final(runs[False, 1]) == final(RunDir("alone"))
    assert {path.name for path in tmp_path.iterdir()} == {"far", "sweep", "alone"}


@pytest.mark.usefixtures("undrawn")
def test_one_after_the_other(tiny, tmp_path):
    assert main(["train", "--multirun", "seed=3,4", *tiny["train"]]) == 0
    (sweep,) = (tmp_path / "runs").iterdir()
    assert set(runs_in(sweep)) == {(True, 3), (True, 4)}


def test_preset_runs_seed_by_seed_and_draws_its_curves(tiny, tmp_path, capsys):
    # what is given beside the preset wins over it, and applies to all of its runs
    values = ["seed=0,1", "experiment=ib,no_stacking", "ppo.epochs=3", "hydra.sweep.dir='it\\'s here'"]
    assert main(["train", "-m", "sweep=parts", *values, *tiny["train"]]) == 0
    folder = tmp_path / "it's here"
    runs = sorted(folder.rglob("config.yaml"), key=lambda path: int(path.parent.name.split("_")[-1]))
    configs = [yaml.safe_load(path.read_text()) for path in runs]
    told = [(c["seed"], c["observation"]["frames"], c["ppo"]["epochs"]) for c in configs]
    assert told == [(0, 3, 3), (0, 1, 3), (1, 3, 3), (1, 1, 3)]
    command = json.loads((runs[1].parent / "run.json").read_text())["command"]
    assert "experiment=no_stacking" in command
    assert not any(word.startswith("sweep=") for word in command)
    curves = json.loads((folder / "curves.json").read_text())["groups"]
    assert {label: group["averaged_seeds"] for label, group in curves.items()} == {"ib": [0, 1], "no_stacking": [0, 1]}
    assert (folder / "curves.png").stat().st_size > 10_000
    assert "learning curves are in" in capsys.readouterr().out


def test_ctrl_c_ends_the_sweep_and_not_just_one_run(tiny, monkeypatch, capsys):
    started = []
    monkeypatch.setattr("forcegrasp.train.loop.train", lambda config, *_: started.append(config.seed))
    assert main(["train", "-m", "seed=0,1,2", *tiny["train"]]) == 130
    assert started == [0]


@pytest.mark.long
@pytest.mark.usefixtures("hang_ups_arrive", "undrawn")
def test_the_same_sweep_again_goes_on(tiny, monkeypatch, capsys):
    """As after a job that a scheduler ended and started anew: finished runs stay, the others end bit for bit alike."""
    log, signals = TrainingLog.batch, [signal.SIGINT, signal.SIGHUP, signal.SIGUSR1]

    def batch(self, *args):
        log(self, *args)
        if signals and self.config.seed == 1:
            signal.raise_signal(signals.pop(0))

    monkeypatch.setattr(TrainingLog, "batch", batch)
    options = [*tiny["train"], "ppo.total_frames=40"]
    sweep = ["train", "-m", "seed=0,1", *options, "hydra.sweep.dir=cut"]
    for frames in (8, 16, 24):
        assert main(sweep) == 130
        assert RunDir("cut/ib_s1_1").load()[1]["frames"] == frames
        told = capsys.readouterr().out
        assert told.count("already trained to the end") == (frames > 8)
        assert "go on with: forcegrasp train -m resume=cut\n" in told
        sweep = ["train", "-m", "resume=cut"]
    assert main(sweep) == 0
    assert capsys.readouterr().out.count("already trained to the end") == 1
    assert main(["train", "seed=1", *options, "hydra.run.dir=alone"]) == 0
    assert final(RunDir("cut/ib_s1_1")) == final(RunDir("alone"))
    with pytest.raises(
        CheckpointError, match=r"already holds a run with another ppo\.epochs; "
    ):  # not the same: left alone
        begin_or_resume(Path("alone"), compose("train", [*options, "seed=1", "ppo.epochs=3"]), [])


def test_a_sweep_is_typed_again_with_what_is_given_in_its_place(tmp_path):
    begun = (
        ["seed=0,1", "sweep=ablation"],
        ["hydra.sweep.dir=a", "hydra/launcher=joblib", "hydra.launcher.n_jobs=2", "hydra.mode=MULTIRUN"],
    )
    record = {"hydra": {"overrides": dict(zip(("task", "hydra"), begun, strict=True))}}
    (tmp_path / "multirun.yaml").write_text(yaml.safe_dump(record))
    folder = f"hydra.sweep.dir='{tmp_path}'"
    assert typed_again(tmp_path, []) == ["seed=0,1", "sweep=ablation", *begun[1][1:3], folder]
    assert typed_again(tmp_path, ["seed=0,1,2"]) == ["sweep=ablation", *begun[1][1:3], "seed=0,1,2", folder]
    slurm = ["hydra/launcher=submitit_slurm", "hydra.launcher.partition=cpu"]
    assert typed_again(tmp_path, slurm) == ["seed=0,1", "sweep=ablation", *slurm, folder]


@pytest.mark.usefixtures("undrawn")
def test_a_run_that_another_sweep_trains_is_named_and_the_others_are_trained(tiny, tmp_path, capsys):
    """As when jobs of a scheduler are still at work when the sweep is typed again."""
    sweep = ["train", "-m", "seed=0,1", *tiny["train"], "hydra.sweep.dir=sweep"]
    with only_writer(Path("sweep/ib_s0_0/lock")):
        assert main(sweep) == 2
    first, _ = capsys.readouterr().err.splitlines()
    assert first.startswith(f"sweep/ib_s0_0: process {os.getpid()} on ")
    assert final(RunDir("sweep/ib_s1_1"))
    assert main(sweep) == 0
    assert not list(Path("sweep").rglob("failed.txt"))


@pytest.mark.long
def test_a_sweep_that_is_stopped_side_by_side_saves_its_runs(tiny, capfd):
    """The signal goes to the sweep alone, as a scheduler's may; the third run does not begin."""
    options = [*tiny["train"], "ppo.total_frames=800000", "log.checkpoint_every=100000"]
    command = ["train", "-m", "seed=0,1,2", *options, "hydra/launcher=joblib", "hydra.launcher.n_jobs=2"]
    runs = [RunDir("sweep/ib_s0_0"), RunDir("sweep/ib_s1_1")]

    ended, deadline = threading.Event(), time.monotonic() + 120

    def stop() -> None:
        while not all(run.metrics_path.exists() for run in runs) and time.monotonic() < deadline:
            if ended.wait(0.05):
                return
        os.kill(os.getpid(), signal.SIGTERM)

    begun = threading.Thread(target=stop)
    begun.start()
    try:
        assert main([*command, "hydra.sweep.dir=sweep"]) == 130
    finally:
        ended.set()
        begun.join()
        get_reusable_executor().shutdown()
    out, err = capfd.readouterr()
    assert err == "forcegrasp: interrupted\n"
    for run in runs:
        assert f"stopped and saved; go on with: forcegrasp train resume={run.path.resolve()}" in out
        assert run.load()[1]["batches"] == len(run.metrics_path.read_text().splitlines()) - 1
    assert {path.parent for path in Path("sweep").rglob("config.yaml")} == {run.path for run in runs}
    assert not Path("sweep/stopped").exists()


def test_submitit_runs_side_by_side_and_a_failing_run_takes_no_other_along(tiny, tmp_path):
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher")
    (tmp_path / "sweep" / "ib_s0_0").mkdir(parents=True)
    (tmp_path / "sweep" / "ib_s0_0" / "config.yaml").touch()  # in the way
    command = ["train", "-m", "seed=0,1", *tiny["train"], "hydra/launcher=submitit_local", "hydra.sweep.dir=sweep"]
    done = subprocess.run(
        [sys.executable, "-m", "forcegrasp.cli.main", *command],
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    first, last = done.stderr.splitlines()
    assert first.startswith("sweep/ib_s0_0: already holds a run")
    assert last.startswith("forcegrasp: 1 of the sweep's runs failed")
    assert final(RunDir("sweep/ib_s1_1"))
    assert "the runs' jobs write to sweep/.submitit" in done.stdout
    assert "learning curves are in sweep/curves.png" in done.stdout
    (told,) = [text for log in Path("sweep/.submitit").glob("*/*.out") if "trained." in (text := log.read_text())]
    assert "sweep/ib_s1_1" in told
    assert main(["curves", "sweep"]) == 0


def test_failing_runs_are_all_named_without_a_traceback(tiny, monkeypatch, capsys):
    from forcegrasp.errors import PhysicsError

    started = []

    def diverge(config, *_):
        started.append(config.seed)
        if config.seed != 1:
            raise PhysicsError(f"grasp {config.seed} diverged")
        return True

    monkeypatch.setattr("forcegrasp.train.loop.train", diverge)
    assert main(["train", "-m", "seed=0,1,2", *tiny["train"]]) == 2
    assert started == [0, 1, 2], "it must not take the others along"
    out, err = capsys.readouterr()
    assert "no learning curves: " in out
    *failed, end = err.splitlines()
    assert [line.rpartition("_s")[2] for line in failed] == ["0_0: grasp 0 diverged", "2_2: grasp 2 diverged"]
    assert end == "forcegrasp: 2 of the sweep's runs failed, see above and failed.txt in their folders"


def test_single_run_is_named_after_time_experiment_and_seed(tiny, tmp_path):
    assert main(["train", "experiment=no_rand", "seed=5", *tiny["train"]]) == 0
    (run,) = (tmp_path / "runs").iterdir()
    assert run.name.endswith("_no_rand_s5")
    assert {path.name for path in run.iterdir()} == {
        "config.yaml",
        "run.json",
        "metrics.csv",
        "checkpoints",
        "tensorboard",
        "figures",
    }
    assert {path.name for path in tmp_path.iterdir()} == {"runs"}
