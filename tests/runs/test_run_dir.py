"""Run directories: a run can be understood and resumed from its directory alone, or says why not."""

from __future__ import annotations

import csv
import dataclasses
import errno
import json
import os
import shutil
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
import torch
import yaml

from forcegrasp.cli.options import compose
from forcegrasp.config import TrainConfig
from forcegrasp.errors import CheckpointError
from forcegrasp.physics import default_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.runs import checkpoint
from forcegrasp.runs.config_file import fingerprint
from forcegrasp.runs.policy import load_policy
from forcegrasp.runs.run_dir import RunDir


def whole_config() -> TrainConfig:
    return complete(TrainConfig(seed=7), default_gripper())


@pytest.fixture
def run(tmp_path) -> RunDir:
    return RunDir.create(tmp_path / "run", whole_config(), ["seed=7"])


def save(run: RunDir, *frames: int, keep: int = 99) -> list[Path]:
    return [run.save(number, {"x": torch.tensor([number])}, {"batches": number}, keep) for number in frames]


def loaded_frames(run: RunDir) -> int:
    tensors, facts = run.load()
    assert tensors["x"].item() == facts["frames"] == facts["batches"]
    return facts["frames"]


def damage(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)


def test_newest_is_by_number_and_not_by_time_or_text(run):
    save(run, 1000, 20, 100, 9)
    assert loaded_frames(run) == 1000


def test_newest_valid_one_is_found(run):
    paths = save(run, 1, 2, 3, 4)
    damage(paths[3])
    paths[2].write_bytes(b"")
    assert loaded_frames(run) == 2
    assert all(path.exists() for path in paths)


def test_all_damaged_says_so_of_the_newest(run):
    paths = save(run, 1, 2)
    for path in paths:
        damage(path)
    with pytest.raises(CheckpointError, match=str(paths[-1])):
        run.load()


def test_no_checkpoint_yet(run):
    with pytest.raises(CheckpointError, match="no checkpoint yet"):
        run.load()


def test_part_files_are_no_checkpoints(run):
    (path,) = save(run, 1)
    shutil.copy(path, run.checkpoints / "frames_000000000002.part")
    assert loaded_frames(run) == 1


@pytest.mark.parametrize("keep", [1, 2, 5])
def test_keep_is_honoured(run, keep):
    for frames in range(10, 50, 10):
        (path,) = save(run, frames, keep=keep)
        assert path.exists()
        kept = sorted(int(p.stem.removeprefix("frames_")) for p in run.checkpoints.iterdir())
        assert kept == list(range(10, frames + 1, 10))[-keep:]


def test_the_best_is_kept_beside_the_newest(run):
    for frames, score in ((1, None), (2, 5.0), (3, 7.0), (4, 6.0), (5, 7.0), (6, None)):
        run.save(frames, {"x": torch.tensor([frames])}, {"batches": frames}, keep=1, score=score)
        (run.checkpoints / "frames_000000000000.part").touch()  # as a kill leaves it
    assert {path.name for path in run.checkpoints.glob("*.safetensors")} == {
        "best.safetensors",
        "frames_000000000006.safetensors",
    }
    assert loaded_frames(run) == 6, "a run goes on from the newest"
    assert run.load_file(run.best)[1]["frames"] == 3, "the first of the best"
    damage(run.best)
    run.save(7, {"x": torch.tensor([7])}, {"batches": 7}, keep=1, score=1.0)
    assert run.load_file(run.best)[1]["frames"] == 7
    assert not list(run.checkpoints.glob("*.part"))


def test_the_best_can_be_had_as_a_policy(run):
    run.save(1, {"policy.module.0.bias": torch.zeros(3)}, {}, keep=1, score=1.0)
    with pytest.raises(CheckpointError, match=r"best\.safetensors: the checkpoint's weights do not fit"):
        load_policy(run.best)
    with pytest.raises(CheckpointError, match="not a readable checkpoint"):
        load_policy(run.checkpoints / "none.safetensors")


def test_checkpoint_that_is_none_of_a_training_is_refused(run):
    checkpoint.write(run.checkpoints / "frames_000000000001.safetensors", {}, {"config": run.fingerprint})
    with pytest.raises(CheckpointError, match="not a checkpoint of a training"):
        run.load()


def test_older_checkpoints_are_removed_only_after_the_new_one_is_written(run, monkeypatch):
    save(run, 1, 2)

    def no_space(*args):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", no_space)
    with pytest.raises(CheckpointError, match="No space left"):
        save(run, 3, keep=1)
    assert loaded_frames(run) == 2
    assert sorted(path.name for path in run.checkpoints.iterdir()) == [
        "frames_000000000001.safetensors",
        "frames_000000000002.safetensors",
    ]


def test_config_round_trip(tmp_path):
    changed = ["experiment=no_rand", "sensors=authors", "ppo.hidden=[3,4,5]", "ppo.learning_rate=1e-7"]
    config = complete(compose("train", changed), default_gripper())
    run = RunDir.create(tmp_path / "run", config, [])
    assert RunDir.open(run.path).config() == config
    assert yaml.safe_load(run.config_path.read_text())["grasp"]["b2"] == [-9.0, -9.0]


def test_fingerprint_tells_configurations_apart():
    one, same, other = (dataclasses.asdict(TrainConfig(seed=seed)) for seed in (0, 0, 1))
    assert fingerprint(one) == fingerprint(same) != fingerprint(other)


def test_a_run_made_before_an_option_existed_stays_readable(run):
    save(run, 1)
    config = yaml.safe_load(run.config_path.read_text())
    del config["model"], config["grasp"]["steps"]
    old = RunDir(run.path)
    old.config_path.write_text(yaml.safe_dump(config))
    save(old, 2)
    assert RunDir.open(run.path).load()[1]["frames"] == 2


def test_checkpoint_of_another_config_is_refused(run, tmp_path):
    save(run, 1)
    other = RunDir.create(tmp_path / "other", TrainConfig(seed=8), [])
    shutil.copytree(run.checkpoints, other.checkpoints, dirs_exist_ok=True)
    with pytest.raises(CheckpointError, match="another configuration"):
        other.load()


@pytest.mark.parametrize(
    "content",
    [
        "seed: [",
        "seed: many",
        "sead: 1",
        "ppo: {grasp: 1}",
        "ppo: {grasps: 0}",
        "ppo: 3",
        "grasp: {kappa: [1, 0]}",
        "seed: ${nope}",
        "_target_: builtins.print",
        "ppo: {_target_: builtins.print}",
        "seed: !!python/object/apply:builtins.print [hello]",
        "- 1",
        "text",
        "3",
        "\0",
        "\x7f\x01",
    ],
)
def test_broken_config_is_refused(run, content, capsys):
    run.config_path.write_text(content)
    with pytest.raises(CheckpointError) as caught:
        run.config()
    assert str(caught.value).startswith(f"{run.config_path}: not a valid configuration (")
    assert "\n" not in str(caught.value)
    assert not capsys.readouterr().out


@pytest.mark.parametrize("name", ["model", "seed", "ppo.hidden", "observation.parts"])
@pytest.mark.parametrize("asked", ["${oc.env:OWN_SECRET}", "x${oc.env:OWN_SECRET}", "${seed}", "${oc.decode:'1'}"])
def test_config_that_asks_for_another_value_is_refused(run, name, asked, monkeypatch):
    """A stranger's file could show what the environment of whoever reads it holds."""
    monkeypatch.setenv("OWN_SECRET", "hunter2")
    options = yaml.safe_load(run.config_path.read_text())
    section, _, leaf = name.rpartition(".")
    (options[section] if section else options)[leaf] = [asked] if section else asked
    run.config_path.write_text(yaml.safe_dump(options))
    with pytest.raises(CheckpointError, match=r"\$\{...\} is not replaced in a file; write the value itself") as caught:
        run.config()
    assert name in str(caught.value)
    assert "hunter2" not in str(caught.value)


def test_config_that_is_no_text_is_refused(run):
    run.config_path.write_bytes(b"seed: \xff\xfe")
    with pytest.raises(CheckpointError):
        run.config()


def test_unknown_key_in_config_is_named(run):
    run.config_path.write_text("sead: 1\n")
    with pytest.raises(CheckpointError, match="sead"):
        run.config()


def test_opening_what_is_no_run(tmp_path):
    with pytest.raises(CheckpointError, match="no such run directory"):
        RunDir.open(tmp_path / "nowhere")
    with pytest.raises(CheckpointError, match=r"no config\.yaml"):
        RunDir.open(tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(CheckpointError):
        RunDir.open(tmp_path / "file")


def test_creating_over_a_run_is_refused(run):
    before = run.config_path.read_text()
    with pytest.raises(CheckpointError, match="already holds a run"):
        RunDir.create(run.path, TrainConfig(seed=9), [])
    assert run.config_path.read_text() == before


def test_a_run_without_a_checkpoint_can_be_begun_again(run):
    run.model_path.write_text("of a file that may have changed since")
    command = json.loads((run.path / "run.json").read_text())["command"]
    assert RunDir.create(run.path, whole_config(), ["seed=7", "log.keep=3"]).config() == whole_config()
    assert not run.model_path.exists()
    assert json.loads((run.path / "run.json").read_text())["command"] == [*command, "log.keep=3"]
    save(run, 1)
    with pytest.raises(CheckpointError, match=f"already holds a run; continue it with resume={run.path}"):
        RunDir.create(run.path, whole_config(), [])


def test_a_run_with_nothing_but_its_best_goes_on_from_that(run):
    run.save(5, {"x": torch.tensor([5])}, {"batches": 5}, keep=1, score=1.0)
    damage(max(run.checkpoints.glob("frames_*")))
    assert loaded_frames(run) == 5
    max(run.checkpoints.glob("frames_*")).unlink()
    assert run.has_checkpoint
    assert loaded_frames(run) == 5


def test_creating_under_a_file_is_refused(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(CheckpointError, match="could not make the run directory"):
        RunDir.create(tmp_path / "file" / "run", TrainConfig(), [])


def test_failed_creation_can_be_repeated(tmp_path, monkeypatch):
    replace = os.replace

    def full(part, path):
        if path.name == "config.yaml":  # the last file of a new run
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        replace(part, path)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        with pytest.raises(CheckpointError, match="No space left"):
            RunDir.create(tmp_path / "run", TrainConfig(), [])
    config = complete(TrainConfig(), default_gripper())
    assert RunDir.create(tmp_path / "run", config, []).config() == config


def test_provenance(run):
    facts = json.loads((run.path / "run.json").read_text())
    assert facts["command"] == ["forcegrasp", "train", "seed=7"]
    assert facts["seed"] == 7
    assert facts["config"] == fingerprint(dataclasses.asdict(whole_config()))
    assert facts["python"] == ".".join(map(str, sys.version_info[:3]))
    for package in ("torch", "torchrl", "mujoco", "numpy", "forcegrasp"):
        assert facts["versions"][package] == version(package)
    assert facts["machine"]["cores"] == os.cpu_count()
    assert facts["git"] is None or set(facts["git"].removesuffix("+")) <= set("0123456789abcdef")


def test_policy_that_does_not_fit_is_refused(run):
    run.save(1, {"policy.module.0.bias": torch.zeros(3)}, {}, keep=1)
    with pytest.raises(CheckpointError, match="do not fit"):
        load_policy(run.path)


def rows(run: RunDir) -> list[dict[str, str]]:
    with open(run.metrics_path, newline="") as file:
        return list(csv.DictReader(file))


def log(run: RunDir, *frames: int) -> None:
    for number in frames:
        run.log_metrics({"frames": number, "episode/return": number / 3})


def test_metrics_after_a_checkpoint_are_dropped(run):
    log(run, 10, 20, 30)
    run.drop_metrics_after(20)
    assert [row["frames"] for row in rows(run)] == ["10", "20"]
    log(run, 30)
    assert [float(row["episode/return"]) for row in rows(run)] == [10 / 3, 20 / 3, 30 / 3]
    assert [path.name for path in run.path.glob("metrics*")] == ["metrics.csv"]


def test_metrics_can_all_be_dropped_and_written_again(run):
    log(run, 10)
    run.drop_metrics_after(0)
    log(run, 10)
    assert [row["frames"] for row in rows(run)] == ["10"]


def test_no_metrics_yet(run):
    run.drop_metrics_after(0)
    assert not run.metrics_path.exists()


@pytest.mark.parametrize("end", ["3", "30", "30,", "30,1", "\0\0\0\0", "30,\0\0"])
def test_a_row_that_a_power_cut_left_unfinished_is_dropped(run, end):
    log(run, 10, 20, 1000)
    text = run.metrics_path.read_text()
    run.metrics_path.write_text(text[: text.index("1000")] + end)
    run.drop_metrics_after(20)
    log(run, 30)
    assert rows(run) == [{"frames": str(n), "episode/return": str(n / 3)} for n in (10, 20, 30)]


@pytest.mark.parametrize("content", ["", "frames", "frames,episo"])
def test_a_header_that_a_power_cut_left_unfinished_is_written_again(run, content):
    run.metrics_path.write_text(content)
    run.drop_metrics_after(20)
    log(run, 30)
    assert rows(run) == [{"frames": "30", "episode/return": str(30 / 3)}]
