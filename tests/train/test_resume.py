"""A resumed run equals the uninterrupted one to the last bit: weights, optimiser, generators and metrics."""

from __future__ import annotations

import os
import pty
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
import torch
from rich.progress import Progress
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from forcegrasp.cli.main import main
from forcegrasp.errors import CheckpointError
from forcegrasp.runs import checkpoint
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.board import tag
from forcegrasp.train.logging import TrainingLog
from forcegrasp.train.loop import Trainer, train


class PowerCutError(Exception):
    """Ends a training where it stands."""


def power_cut() -> None:
    raise PowerCutError


def ctrl_c() -> None:
    signal.raise_signal(signal.SIGINT)


def terminate() -> None:
    signal.raise_signal(signal.SIGTERM)


def hang_up() -> None:
    signal.raise_signal(signal.SIGHUP)
    signal.raise_signal(signal.SIGHUP)  # a shell passes it on, and so does the system when the shell is gone


def preempt() -> None:
    signal.raise_signal(signal.SIGUSR1)


@contextmanager
def after_batch(number: int, action: Callable[[], None]) -> Iterator[None]:
    """Calls the action once that batch has been logged, before it can be saved."""
    log = TrainingLog.batch

    def batch(self, count, *args):
        log(self, count, *args)
        if count == number:
            action()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TrainingLog, "batch", batch)
        yield


def final(run: RunDir) -> bytes:
    """The last checkpoint, as it is on the disk."""
    return max(run.checkpoints.iterdir()).read_bytes()


SECTIONS = {
    "default": {"log": {"checkpoint_every": 2, "keep": 99}},
    "other": {
        "collector": {"ahead": False},
        "log": {"checkpoint_every": 2, "keep": 99},
        "ppo": {"critic": "observation", "mirrored": False, "entropy_weight": 0.01, "grasps": 3, "total_frames": 450},
        "observation": {"frames": 1},
        "curriculum": {"end_fraction": 0.9},
        "action": {"inductive_bias": False},
    },
}


@pytest.fixture(scope="module", params=SECTIONS)
def whole(request, tmp_path_factory, tiny, trained) -> RunDir:
    """A run that nobody interrupted: five batches, checkpoints after 2, 4 and 5."""
    return trained(tmp_path_factory.mktemp("whole") / "run", tiny(**SECTIONS[request.param]))


@pytest.fixture
def run(whole, tmp_path) -> RunDir:
    return RunDir.create(tmp_path / "run", whole.config(), [])


def resume(run: RunDir) -> bool:
    torch.manual_seed(12345)  # what a new process would have, or not
    return train(run.config(), run, resume=True)


@pytest.fixture
def equal(metrics) -> Callable[[RunDir, RunDir], bool]:
    return lambda one, other: final(one) == final(other) and metrics(one) == metrics(other)


@pytest.mark.parametrize(
    ("number", "action"),
    [(1, hang_up), (2, ctrl_c), (3, preempt), (4, terminate)],
)
@pytest.mark.usefixtures("hang_ups_arrive")
def test_after_a_signal(whole, run, equal, number, action):
    signals = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1)
    handlers = [signal.getsignal(number) for number in signals]
    with after_batch(number, action):
        assert not train(run.config(), run)
    assert [signal.getsignal(number) for number in signals] == handlers
    assert run.load()[1]["batches"] == number
    assert resume(run)
    assert equal(run, whole)


@pytest.mark.parametrize("number", [3, 4])
def test_after_a_power_cut(whole, run, equal, metrics, number):
    with after_batch(number, power_cut), pytest.raises(PowerCutError):
        train(run.config(), run)
    assert run.load()[1]["batches"] == 2
    assert len(metrics(run)) == number
    assert resume(run)
    assert equal(run, whole)


def test_after_many_interruptions(whole, run, equal):
    with after_batch(1, ctrl_c):
        train(run.config(), run)
    with after_batch(2, ctrl_c):
        assert not resume(run)
    with after_batch(3, power_cut), pytest.raises(PowerCutError):
        resume(run)
    with after_batch(4, terminate):
        assert not resume(run)
    assert resume(run)
    assert equal(run, whole)


def test_with_the_newest_checkpoint_damaged(whole, run, equal):
    with after_batch(4, ctrl_c):
        train(run.config(), run)
    newest = max(run.checkpoints.iterdir())
    newest.write_bytes(newest.read_bytes()[:-1])
    assert resume(run)
    assert equal(run, whole)


MODEL = """format: forcegrasp-model/1
gripper: tiago
base:
  position_gain: {value: 95.0, low: 80.0, high: 110.0}
  velocity_gain: {value: -8.0, low: -9.0, high: -7.0}
effects:
  command_delay: {delay_s: {value: 0.02, low: 0.0, high: 0.06}}
  force_bias: {left_n: {value: 0.02, low: 0.0, high: 0.04}, right_n: -0.01}
"""


def test_with_a_model_that_is_gone_by_then(tmp_path, tiny, trained, equal):
    """The run keeps a copy: a training with a fitted model is resumed bit by bit without the file it was given."""
    given = tmp_path / "fitted.yaml"
    given.write_text(MODEL)
    config = tiny(log={"checkpoint_every": 2, "keep": 99})
    nominal = trained(tmp_path / "nominal", config)
    config.model = str(given)
    whole = trained(tmp_path / "whole", config)
    assert final(whole) != final(nominal)
    run = RunDir.create(tmp_path / "run", config, [])
    with after_batch(2, ctrl_c):
        assert not train(config, run)
    given.unlink()
    with after_batch(3, power_cut), pytest.raises(PowerCutError):
        resume(run)
    assert resume(run)
    assert equal(run, whole)


def test_a_model_that_changed_meanwhile_does_not_change_the_run(tmp_path, tiny, trained, equal):
    given = tmp_path / "fitted.yaml"
    given.write_text(MODEL)
    config = tiny()
    config.model = str(given)
    whole = trained(tmp_path / "whole", config)
    run = RunDir.create(tmp_path / "run", config, [])
    with after_batch(2, ctrl_c):
        train(config, run)
    given.write_text(MODEL.replace("0.06", "0.3"))
    assert resume(run)
    assert equal(run, whole)


def test_second_ctrl_c_ends_at_once(run):
    def twice():
        ctrl_c()
        ctrl_c()

    with after_batch(2, twice), pytest.raises(KeyboardInterrupt):
        train(run.config(), run)


@pytest.mark.parametrize("again", ["resume", "same command"])
def test_interrupted_before_the_first_checkpoint(whole, run, equal, again):
    """It is begun again, and nothing of the first attempt is left in what it shows."""
    with after_batch(1, power_cut), pytest.raises(PowerCutError):
        train(run.config(), run)
    assert not run.has_checkpoint
    assert resume(run) if again == "resume" else train(run.config(), RunDir.create(run.path, run.config(), []))
    assert equal(run, whole)
    events = EventAccumulator(str(run.tensorboard), size_guidance={"scalars": 0}).Reload()
    steps = [event.step for event in events.Scalars(tag("episode/return"))]
    assert steps == sorted(set(steps))
    assert len(events.Tensors("2_config/text_summary")) == 1


def test_a_signal_before_the_first_batch_leaves_a_checkpoint(run, monkeypatch):
    collect = Trainer.collect

    def interrupted(self):
        if not self.frames:
            terminate()
        return collect(self)

    monkeypatch.setattr(Trainer, "collect", interrupted)
    assert not train(run.config(), run)
    assert run.load()[1]["batches"] == 1


def test_a_signal_after_a_batch_was_not_saved_saves_the_next(run, monkeypatch):
    """Whatever instant it comes at, no batch is lost."""
    show = Progress.update

    def update(self, *args, **kwargs):
        show(self, *args, **kwargs)
        if kwargs["completed"] == run.config().ppo.total_frames * 3 // 5:
            terminate()

    monkeypatch.setattr(Progress, "update", update)
    assert not train(run.config(), run)
    assert run.load()[1]["batches"] == 4


def test_signals_that_others_wait_for_are_left_to_them(whole, run, equal, monkeypatch):
    """nohup ignores hang-ups; SLURM's jobs of submitit may be told by SIGUSR1 to start anew."""
    told = []
    before = [signal.signal(signal.SIGHUP, signal.SIG_IGN), signal.signal(signal.SIGUSR1, lambda *_: told.append(1))]
    try:
        with after_batch(1, lambda: (hang_up(), preempt())):
            assert train(run.config(), run)
    finally:
        signal.signal(signal.SIGHUP, before[0])
        signal.signal(signal.SIGUSR1, before[1])
    assert told
    assert equal(run, whole)


def test_a_second_training_of_a_run_at_work_is_refused(whole, run, equal):
    tried = []

    def second():
        tried.append(1)
        assert len(tried) == 1, "it was let in"
        with pytest.raises(CheckpointError, match=f"process {os.getpid()} on .* is training here"):
            train(run.config(), run, resume=True)
        with pytest.raises(CheckpointError, match="is training here"):
            RunDir.create(run.path, run.config(), [])

    with after_batch(2, second):
        assert train(run.config(), run)
    assert equal(run, whole)
    assert not (run.path / "lock").exists()


@pytest.mark.parametrize("number", [0, 2])
def test_best_is_none_of_the_curriculum(tmp_path, tiny, trained, monkeypatch, number):
    """A batch counts once all of it was the whole task: the curriculum ends within the batch of that number."""
    scores = []
    save = RunDir.save

    def spy(self, *args, score, **kwargs):
        scores.append(score)
        return save(self, *args, score=score, **kwargs)

    monkeypatch.setattr(RunDir, "save", spy)
    end = (number + 0.5) / 5
    run = trained(tmp_path, tiny(curriculum={"end_fraction": end}, log={"checkpoint_every": 1}))
    assert [score is None for score in scores] == [batch <= number for batch in range(5)]
    best = max(score for score in scores if score is not None)
    assert run.load_file(run.best)[1]["batches"] == scores.index(best) + 1


def test_same_seed_same_result(whole, run, equal):
    train(run.config(), run)
    assert equal(run, whole)


def weights(run: RunDir) -> dict[str, torch.Tensor]:
    return run.load()[0]


def test_other_seed_other_result(tmp_path, tiny, trained):
    one, other = (weights(trained(tmp_path / str(seed), tiny(seed=seed))) for seed in (0, 1))
    learned = [name for name in one if name.endswith("weight")]
    assert learned
    assert not any(torch.equal(one[name], other[name]) for name in learned)


def test_seed_decides_everything_random(tiny):
    """Each stream on its own: first weights, order of frames, grasps, sensor noise and actions."""

    def streams(seed: int) -> dict[str, torch.Tensor]:
        trainer = Trainer(tiny(seed=seed))
        first = {"weights": trainer.algorithm.value.module.net[0].weight.detach().clone()}
        first["order"] = torch.randperm(100, generator=trainer.algorithm.shuffle)
        start = trainer.env.reset()
        noise = start["sensed_force"] - start["force"]
        with torch.no_grad():
            return first | {
                "grasps": start["grasp_parameters"].clone(),
                "noise": noise,
                "actions": trainer.policy(start)["action"],
            }

    one, same, other = streams(3), streams(3), streams(4)
    for name in one:
        assert torch.equal(one[name], same[name]), name
        assert not torch.equal(one[name], other[name]), name


def test_logs_and_threads_do_not_change_what_is_learned(tmp_path, tiny, trained):
    chatty = {"histograms_every": 1, "figures_every": 2, "checkpoint_every": 1, "keep": 1}
    one = weights(trained(tmp_path / "quiet", tiny()))
    other = weights(trained(tmp_path / "chatty", tiny(log=chatty, physics={"threads": 2})))
    assert one.keys() == other.keys()
    assert all(torch.equal(one[name], other[name]) for name in one)


def test_resuming_a_finished_run_leaves_it_alone(whole, capsys):
    before = final(whole), whole.metrics_path.read_bytes()
    assert main(["train", f"resume={whole.path}"]) == 0
    assert "already trained" in capsys.readouterr().out
    assert (final(whole), whole.metrics_path.read_bytes()) == before


@pytest.mark.long
def test_command_line_after_ctrl_c(tmp_path, metrics):
    """The whole way: a process is interrupted, says so, and another one goes on."""
    options = ["ppo.total_frames=800", "ppo.grasps=2", "grasp.steps=10", "physics.threads=1", "ppo.hidden=[8]"]
    quiet = ["log.histograms_every=0", "log.figures_every=0", "log.video_every=0", "log.checkpoint_every=1000"]
    command = ["train", *options, *quiet]
    run, uninterrupted = RunDir(tmp_path / "run"), RunDir(tmp_path / "whole")
    process = subprocess.Popen(
        [sys.executable, "-m", "forcegrasp.cli.main", *command, f"hydra.run.dir={run.path}"],
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 60
    while not run.metrics_path.exists() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert out.splitlines()[-1] == f"stopped and saved; go on with: forcegrasp train resume={run.path}"
    assert not err
    assert 1 <= len(metrics(run)) < 40
    assert checkpoint.read(max(run.checkpoints.iterdir()))[1]["batches"] == len(metrics(run))

    assert main(["train", f"resume={run.path}"]) == 0
    assert main([*command, f"hydra.run.dir={uninterrupted.path}"]) == 0
    assert final(run) == final(uninterrupted)
    assert metrics(run) == metrics(uninterrupted)


@pytest.mark.long
@pytest.mark.usefixtures("hang_ups_arrive")
def test_command_line_after_a_lost_terminal(tmp_path, metrics):
    """As when an ssh connection breaks: the terminal is gone, what is printed has no reader, and the run is saved."""
    options = ["ppo.total_frames=800000", "ppo.grasps=2", "grasp.steps=40", "physics.threads=1", "ppo.hidden=[8]"]
    quiet = ["log.histograms_every=0", "log.figures_every=0", "log.video_every=0", "log.checkpoint_every=100000"]
    run = RunDir(tmp_path / "run")
    command = [sys.executable, "-m", "forcegrasp.cli.main", "train", *options, *quiet, f"hydra.run.dir={run.path}"]
    process, terminal = pty.fork()
    if not process:
        os.execve(sys.executable, command, {**os.environ, "OMP_NUM_THREADS": "1"})
    deadline = time.monotonic() + 120
    while not run.metrics_path.exists() and time.monotonic() < deadline:
        if select.select([terminal], [], [], 0.02)[0]:
            os.read(terminal, 10_000)
    os.close(terminal)
    assert os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]) == 130
    assert run.load()[1]["batches"] == len(metrics(run))
