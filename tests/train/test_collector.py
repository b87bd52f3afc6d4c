"""Workers simulate what direct collectors with their seeds would: shown side by side in this process, and with Ray."""

from __future__ import annotations

import contextlib
import copy
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import torch

from forcegrasp.config import TrainConfig
from forcegrasp.errors import ConfigError, ForcegraspError, PhysicsError
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train import cluster
from forcegrasp.train.collector import GraspCollector, NextBatch, training_env, worker_seed
from forcegrasp.train.logging import TrainingLog
from forcegrasp.train.loop import train


class SideBySide:
    """Direct collectors that take turns in this process, each with a torch generator and a policy of its own."""

    def __init__(self, config, env, policy, schedule, frames_per_batch, model) -> None:
        self.torch_states = [torch.get_rng_state()]
        self.members = []
        for worker in range(config.collector.workers):
            if worker:
                seeded = torch.Generator().manual_seed(worker_seed(config.seed, worker))
                self.torch_states.append(seeded.get_state())
            member = GraspCollector(
                training_env(config, model, worker),
                copy.deepcopy(policy),
                schedule=schedule,
                frames_per_batch=frames_per_batch // config.collector.workers,
            )
            self.members.append(member)

    def turn(self, worker: int, call: Callable, *arguments: Any) -> Any:
        torch.set_rng_state(self.torch_states[worker])
        result = call(*arguments)
        self.torch_states[worker] = torch.get_rng_state()
        return result

    def map_fn(self, name: str, arguments: list[tuple] | None = None) -> list[Any]:
        told = arguments or [()] * len(self.members)
        return [self.turn(w, getattr(m, name), *told[w]) for w, m in enumerate(self.members)]

    def __iter__(self) -> Iterator:
        collecting = [iter(member) for member in self.members]
        while True:
            yield torch.cat([self.turn(w, next, batches).clone() for w, batches in enumerate(collecting)])


@contextlib.contextmanager
def collecting(batches: NextBatch) -> Iterator[None]:
    """As a training does, but for shutting down the double."""
    batches.ahead = batches.may_be_ahead
    try:
        yield
    finally:
        batches.end()


@pytest.fixture
def side_by_side(monkeypatch) -> None:
    """Trainings use that double in place of Ray."""
    monkeypatch.setattr("forcegrasp.train.loop.make_collector", SideBySide)
    monkeypatch.setattr("forcegrasp.train.loop.collecting", collecting)


@contextlib.contextmanager
def stopped_after(number: int) -> Iterator[list]:
    """Stops a training as Ctrl-C would, after so many batches; yields the batches."""
    log, batches = TrainingLog.batch, []

    def batch(self, count, frames, groups, episodes):
        log(self, count, frames, groups, episodes)
        batches.append(episodes.clone())
        if count == number:
            signal.raise_signal(signal.SIGINT)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TrainingLog, "batch", batch)
        yield batches


def newest(run: RunDir) -> bytes:
    return max(run.checkpoints.iterdir()).read_bytes()


def test_each_worker_has_grasps_noise_and_actions_of_its_own(tiny, tmp_path, side_by_side):
    config = tiny(collector={"kind": "ray", "workers": 3}, ppo={"grasps": 6})
    with stopped_after(2) as batches:
        train(config, RunDir.create(tmp_path, config, []))
    for batch in batches:
        assert batch.shape == (6, 30)
        drawn = batch["goal_force"][:, 0], (batch["sensed_force"] - batch["force"])[:, 0], batch["action"][:, 0]
        assert all(len(values.unique(dim=0)) == 6 for values in drawn)


def test_one_worker_trains_as_this_process_does(tiny, tmp_path, trained, monkeypatch):
    direct = trained(tmp_path / "direct", tiny())
    with monkeypatch.context() as patch:
        patch.setattr("forcegrasp.train.loop.make_collector", SideBySide)
        patch.setattr("forcegrasp.train.loop.collecting", collecting)
        worker = trained(tmp_path / "worker", tiny(collector={"kind": "ray"}))
    (one, facts), (other, its_facts) = direct.load(), worker.load()
    assert one.keys() == other.keys()
    assert all(torch.equal(one[name], other[name]) for name in one)
    assert {**facts, "config": None} == {**its_facts, "config": None}


@pytest.mark.parametrize(
    ("sections", "told"),
    [
        ({"collector": {"workers": 2}}, "collector.workers=2: direct collection is this process alone"),
        ({"collector": {"address": "auto"}}, "collector.address=auto: direct collection"),
        ({"collector": {"kind": "ray", "workers": 3}, "ppo": {"grasps": 4}}, "collector.workers=3: make it 6"),
    ],
)
def test_what_can_not_be_is_refused(tiny, sections, told):
    with pytest.raises(ConfigError, match=told.replace("(", r"\(")):
        tiny(**sections)


def test_each_workers_threads_are_its_own(tiny):
    for threads, expected in ((0, 1), (3, 3)):
        config = tiny(collector={"kind": "ray", "workers": 2}, ppo={"grasps": 8}, physics={"threads": threads})
        simulator = training_env(config).base_env.simulator
        assert (simulator.n, simulator.plant.batch.nthread) == (4, expected)


class FakeRay:
    """Ray as far as joining goes: remembers what it was asked."""

    def __init__(self, refusal: Exception | None = None) -> None:
        self.asked: dict[str, Any] = {}
        self.refusal = refusal

    def is_initialized(self) -> bool:
        return bool(self.asked)

    def init(self, address: str, **options: Any) -> None:
        if self.refusal:
            raise self.refusal
        self.asked = {"address": address, **options}


def joined(monkeypatch, config: TrainConfig, refusal: Exception | None = None) -> dict[str, Any]:
    fake = FakeRay(refusal)
    monkeypatch.setattr(cluster, "find_ray", lambda: fake)
    cluster.join(config)
    cluster.join(config)  # once is enough
    return fake.asked


def test_starts_a_cluster_of_this_machine_or_joins_one(tiny, monkeypatch):
    ray = {"kind": "ray", "workers": 2}
    auto = ray | {"address": "auto"}
    asked = joined(monkeypatch, tiny(collector=ray, physics={"threads": 3}))
    assert (asked["address"], asked["num_cpus"]) == ("local", 6)
    asked = joined(monkeypatch, tiny(collector=auto))
    assert asked["address"] == "auto"
    assert "num_cpus" not in asked
    with pytest.raises(ConfigError, match=r"collector.address=auto: this machine is not part of .*: ray start --head$"):
        joined(monkeypatch, tiny(collector=auto), ConnectionError("long\nstory"))
    with pytest.raises(ConfigError, match=r"Ray could not be started here \(no disk\)"):
        joined(monkeypatch, tiny(collector=ray), OSError("no disk"))


def test_errors_of_workers_are_told_as_ones_own():
    errors = pytest.importorskip("ray.exceptions")
    diverged = errors.RayTaskError("next", "a long traceback", PhysicsError("grasp 3 diverged")).as_instanceof_cause()
    with pytest.raises(PhysicsError, match=r"^grasp 3 diverged$"), cluster.translate_ray_errors():
        raise diverged
    fault = errors.RayTaskError("next", "a long traceback", KeyError("x")).as_instanceof_cause()
    with pytest.raises(KeyError), cluster.translate_ray_errors():
        raise fault
    with pytest.raises(ForcegraspError, match="a worker or the Ray cluster is gone"), cluster.translate_ray_errors():
        raise errors.ActorDiedError


# --- with Ray: slow to start, so once for all ------------------------------------------------------------------------

MARK = "FORCEGRASP_TEST_OF_RAY"
OPTIONS = ["ppo.total_frames=100000", "ppo.grasps=4", "grasp.steps=40", "physics.threads=1", "ppo.hidden=[8]"]
QUIET = ["log.histograms_every=0", "log.figures_every=0", "log.video_every=0", "log.checkpoint_every=100000"]


class Interrupted(NamedTuple):
    run: RunDir
    status: int
    out: str
    err: str
    left: list[str]  #: commands of processes that outlived it


def alive(mark: str) -> list[str]:
    """Commands of the processes that were started with this mark."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if f"{MARK}={mark}".encode() in (process / "environ").read_bytes():
                found.append((process / "cmdline").read_text().replace("\0", " ").strip())
    return [command for command in found if command]


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory) -> Interrupted:
    """A training with two of Ray's workers on this machine that gets Ctrl-C, as does all that it started."""
    pytest.importorskip("ray")
    folder = tmp_path_factory.mktemp("ray")
    run, mark = RunDir(folder / "run"), str(os.getpid())
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "forcegrasp.cli.main",
            "train",
            "collector=ray",
            *OPTIONS,
            *QUIET,
            f"hydra.run.dir={run.path}",
        ],
        env={
            **os.environ,
            MARK: mark,
            "RAY_AUTH_TOKEN": "0123456789abcdef" * 4,
        },  # lest it keeps one in the home folder
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 240
    while process.poll() is None and time.monotonic() < deadline:
        if run.metrics_path.exists() and run.metrics_path.read_bytes().count(b"\n") > 3:
            break
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    deadline = time.monotonic() + 20
    while alive(mark) and time.monotonic() < deadline:
        time.sleep(0.2)
    return Interrupted(run, process.returncode, out, err, alive(mark))


def test_ctrl_c_saves_and_ends_all_processes(interrupted):
    assert interrupted.status == 130, interrupted.err
    assert interrupted.left == []


def test_the_terminal_shows_what_it_shows_without_ray(interrupted):
    first, *_, last = interrupted.out.splitlines()
    assert first == f"run directory: {interrupted.run.path}"
    assert last == f"stopped and saved; go on with: forcegrasp train resume={interrupted.run.path}"
    assert not interrupted.err
    assert "ray" not in interrupted.out.replace(str(interrupted.run.path), "").lower()


def test_two_workers_do_what_two_direct_collectors_do(interrupted, tmp_path, side_by_side, metrics):
    """Same episodes, hence same weights, generators and figures to the last bit: the curriculum arrived as well."""
    config, batches = interrupted.run.config(), interrupted.run.load()[1]["batches"]
    run = RunDir.create(tmp_path / "run", config, [])
    with stopped_after(batches):
        assert not train(config, run)
    assert newest(run) == newest(interrupted.run)
    assert metrics(run) == metrics(interrupted.run)


def test_resumes_bit_by_bit(interrupted, tmp_path, side_by_side):
    config, batches = interrupted.run.config(), interrupted.run.load()[1]["batches"]
    whole, resumed = (RunDir.create(tmp_path / name, config, []) for name in ("whole", "resumed"))
    with stopped_after(batches + 2):
        train(config, whole)
    resumed.save(batches * 160, *interrupted.run.load(), keep=1)
    torch.manual_seed(12345)
    with stopped_after(batches + 2):
        train(config, resumed, resume=True)
    assert newest(whole) == newest(resumed)
