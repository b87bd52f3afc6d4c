"""``forcegrasp train``: one run, a sweep (-m), or the continuation of a run (resume=)."""

from __future__ import annotations

import dataclasses
import os
import re
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.cli.options import compose, compose_run, compose_sweep, help_text, parse_override, spell_sweep
from forcegrasp.errors import ConfigError, ForcegraspError

if TYPE_CHECKING:
    from forcegrasp.config import TrainConfig
    from forcegrasp.physics import Gripper
    from forcegrasp.runs.run_dir import RunDir

#: Why a run of a sweep failed, in its folder.
FAILURE = "failed.txt"
#: One of a sweep's runs that train side by side was stopped: no further one begins.
STOPPED = "stopped"
#: Exit status after Ctrl-C, as shells have it.
INTERRUPTED = 130
#: Letters of a model's name in the name of a run.
_LONGEST = 40
PURPOSE = "learn a grasp-force policy with PPO"
NOTES = """
  -m / --multirun    run every combination of comma-separated values:
                     forcegrasp train -m experiment=ib,no_ib seed=0,1,2   (hydra/launcher=joblib: side by side)
                     forcegrasp train -m sweep=ablation                   the combinations of a preset
                     the same sweep with hydra.sweep.dir=FOLDER goes on with what is in that folder
  resume=RUN_DIR     go on with an interrupted run, exactly as if it had not been interrupted
  hydra.run.dir=DIR  where to write the run; runs/TIME_EXPERIMENT_GRIPPER_MODEL_SEED by default

Watch a training with: tensorboard --logdir runs. Ctrl-C saves and ends; so do SIGTERM, SIGHUP and SIGUSR1.
"""


def main(arguments: list[str]) -> int:
    """Runs the verb; returns the exit status."""
    if any(a in ("-h", "--help") for a in arguments):
        print(help_text("train", PURPOSE, NOTES, everything="--all" in arguments), end="")
        return 0
    resume = [a for a in arguments if a.startswith("resume=")]
    multirun = [a for a in arguments if a in ("-m", "--multirun")]
    overrides = [a for a in arguments if a not in resume and a not in multirun]
    if resume:
        if resume[-1] == "resume=":
            raise ConfigError("resume= needs a run directory, as forcegrasp train printed it")
        if overrides or multirun or len(resume) > 1:
            raise ConfigError(
                f"resume= goes on with the run's own configuration; drop {' '.join(overrides + multirun) or 'one'}"
            )
        return _resume(Path(resume[0].partition("=")[2]))
    return _sweep(overrides) if multirun else _run(overrides)


def _run(overrides: list[str]) -> int:
    config, run_dir = compose_run("train", overrides, _run_name(overrides))
    if preset := next((o for o in overrides if o.startswith("sweep=") and o != "sweep=none"), ""):
        raise ConfigError(f"{preset} is several runs: add -m to run one after another")
    config = _check(config)
    _join(config)
    return _begin(config, Path(run_dir), overrides)


def _run_name(overrides: list[str]) -> list[str]:
    """An override that puts gripper and model, where they are given, into the run's name; else none."""
    given = {text.partition("=")[0]: text for text in overrides}
    names = [_name_of(key, parse_override(given[key])) for key in ("gripper", "model") if key in given]
    if not any(names):
        return []
    return [f"hydra.job.name='${{hydra:runtime.choices.experiment}}_{'_'.join(filter(None, names))}'"]


def _name_of(key: str, given: Any) -> str:
    """What a gripper or a model adds to the run's name; empty for the default one, and for models that differ."""
    if given.is_sweep_override():
        plain = key == "gripper" and all(name.isidentifier() for name in given.sweep_string_iterator())
        return "${gripper}" * plain
    path = Path(str(given.value()))
    if str(path) in (".", DEFAULT_GRIPPER):
        return ""
    stem = path.parent.name if path.stem == "model" and path.parent.name else path.stem  # runs/diagnose_TIME/model.yaml
    return re.sub(r"[^\w.-]", "_", stem)[:_LONGEST]


def _completed(config: TrainConfig) -> tuple[TrainConfig, Gripper]:
    """The configuration with what it leaves to the gripper's description and the model's noise, and the gripper."""
    from forcegrasp.models.variation import read_model_of, with_noise_of
    from forcegrasp.physics import load_gripper
    from forcegrasp.physics.completion import complete

    gripper = load_gripper(config.gripper)
    model = read_model_of(gripper, config.model) if config.model else None
    return dataclasses.replace(complete(config, with_noise_of(gripper, model)), gripper=gripper.name_or_path), gripper


def _check(config: TrainConfig) -> TrainConfig:
    """Refuses what can't be trained before anything is written; returns the whole configuration."""
    from forcegrasp.config import validate
    from forcegrasp.gpu import check_engine
    from forcegrasp.gpu.installation import check_gripper_for_warp
    from forcegrasp.physics import GraspSampler
    from forcegrasp.physics.gripper import NO_FORCES

    check_engine(config.physics)
    config, gripper = _completed(config)
    validate(config)
    GraspSampler(config.grasp, gripper).set_ranges(config.curriculum.radius_m, config.curriculum.offset_m)
    if not gripper.forces:
        raise ConfigError(f"gripper={config.gripper}: {NO_FORCES}")
    if config.physics.engine == "warp":
        check_gripper_for_warp(gripper)
    if config.collector.kind == "ray":
        from forcegrasp.train.cluster import find_ray

        find_ray()
    return config


def _join(config) -> None:
    """Refuses a Ray cluster that does not answer before anything is written."""
    if config.collector.kind == "ray":
        from forcegrasp.train.cluster import join

        join(config)


def _sweep(overrides: list[str]) -> int:
    if preset := next((o for o in overrides if o.startswith("sweep=") and "," in o), ""):
        raise ConfigError(f"{preset}: one preset at a time")
    overrides = spell_sweep("train", overrides)
    launcher = next((o for o in overrides if o.startswith("hydra/launcher=submitit_")), "")
    if launcher and not find_spec("hydra_plugins.hydra_submitit_launcher"):
        raise ConfigError(f"{launcher} needs an extra: pip install 'forcegrasp[cluster]'")
    for single in single_runs(overrides):
        _check(compose("train", single))  # refuses bad input before anything is written
    _, folder = compose_sweep(_without_several_values(overrides))
    import hydra
    from hydra.core.global_hydra import GlobalHydra
    from omegaconf import DictConfig

    GlobalHydra.instance().clear()
    os.environ["HYDRA_FULL_ERROR"] = "1"  # exceptions reach the caller, who says it in one line

    @hydra.main(version_base="1.3", config_path="pkg://forcegrasp.conf", config_name="train")
    def job(composed: DictConfig) -> int:
        return _sweep_job(composed)

    quoted = folder.replace("\\", "\\\\").replace("'", "\\'")
    sys.argv = ["forcegrasp train", "-m", *_run_name(overrides), *overrides, f"hydra.sweep.dir='{quoted}'"]
    from forcegrasp.runs.lock import only_writer

    with only_writer(Path(folder) / "sweep.lock"):
        if launcher:
            print(f"the runs' jobs write to {folder}/.submitit")
        try:
            if "hydra/launcher=joblib" in overrides:
                _side_by_side(job, Path(folder) / STOPPED)
            else:
                job()
        except Exception as error:
            if type(error).__module__.startswith("submitit."):
                reason = " ".join(str(error).splitlines()[:2])
                raise ForcegraspError(f"{reason}; the same sweep typed again goes on") from error
            raise
        finally:  # a sweep that was cut short has something to show, too
            _draw_curves(Path(folder))
    return _tell_failures(sorted(Path(folder).rglob(FAILURE)))


def _side_by_side(job: Callable[[], None], stopped: Path) -> None:
    """Runs a sweep in processes of joblib, which would kill them all at Ctrl-C: here they save and end first."""
    from forcegrasp.train.stop import stop_signals, tell_workers

    def stop() -> None:
        stopped.touch()
        tell_workers()

    stopped.unlink(missing_ok=True)
    try:
        with stop_signals(stop):
            job()
        if stopped.exists():
            raise KeyboardInterrupt
    except Exception as error:
        if stopped.exists():  # a process that had nothing to save was gone at once, which joblib complains about
            raise KeyboardInterrupt from error
        raise
    finally:
        stopped.unlink(missing_ok=True)


def _tell_failures(files: list[Path]) -> int:
    """Raises ForcegraspError if runs of a sweep failed, after a line about each; returns the exit status 0 if not."""
    for file in files:
        reason = file.read_text("utf-8").strip()
        for name in (file.parent, file.parent.absolute()):
            reason = reason.removeprefix(f"{name}: ")
        print(f"{file.parent}: {reason}", file=sys.stderr)
    if files:
        raise ForcegraspError(f"{len(files)} of the sweep's runs failed, see above and {FAILURE} in their folders")
    return 0


def _draw_curves(folder: Path) -> None:
    """Draws what the runs of a sweep have learned; says why where it can't."""
    from forcegrasp.evaluate.curves import learning_curves

    try:
        learning_curves([folder], folder)
    except (ForcegraspError, OSError) as error:
        print(f"no learning curves: {error}")


def _sweep_job(composed) -> int:
    from hydra.core.hydra_config import HydraConfig
    from omegaconf import OmegaConf

    from forcegrasp.cli.main import import_mujoco
    from forcegrasp.cli.terminal import show_everything

    show_everything()  # a launcher may have started a process of its own
    import_mujoco()
    hydra, config = HydraConfig.get(), cast("TrainConfig", OmegaConf.to_object(composed))
    overrides = [text for text in hydra.overrides.task if not text.startswith("sweep=")]  # this run is a single one
    launcher, stopped = str(hydra.runtime.choices["hydra/launcher"]), Path(hydra.sweep.dir) / STOPPED
    if stopped.exists():
        return INTERRUPTED
    path = Path(hydra.runtime.output_dir)
    (path / FAILURE).unlink(missing_ok=True)
    try:
        status = _begin_or_resume(path, config, overrides)
    except (ForcegraspError, OSError) as error:  # raised here, Hydra would tell of the first one alone
        (path / FAILURE).write_text(f"{error}\n", "utf-8")
        return 2
    (path / FAILURE).unlink(missing_ok=True)  # of another job that found this one at work
    if status == INTERRUPTED:
        if launcher.startswith("submitit_"):  # a scheduler ended this job alone
            raise ForcegraspError(f"{path}: stopped and saved; the same sweep typed again goes on")
        if launcher == "joblib":  # which would kill the others before they have saved
            stopped.touch()
            return INTERRUPTED
        raise KeyboardInterrupt  # ends the sweep, not just this run
    return status


def _begin_or_resume(path: Path, config: TrainConfig, overrides: list[str]) -> int:
    """Goes on with this very run if a scheduler started its job anew, or if the sweep was typed again."""
    from forcegrasp.runs.run_dir import RunDir

    config, _ = _completed(config)
    _join(config)
    if RunDir(path).has_checkpoint and RunDir.open(path).config() == config:
        return _resume(path)
    return _begin(config, path, overrides)


def single_runs(overrides: list[str]) -> list[list[str]]:
    """A sweep's values one at a time, to check them: each override list has no sweep in it.

    What is given for an option replaces what the preset of ``sweep`` has for it.
    """
    preset, _ = compose_sweep(_without_several_values(overrides))
    given = {parse_override(text).get_key_element() for text in overrides}
    fixed, swept = [], []
    for text in [f"{key}={values}" for key, values in preset.items() if key not in given] + overrides:
        parsed = parse_override(text)
        if parsed.is_sweep_override() and parsed.is_discrete_sweep():
            swept.append([f"{parsed.get_key_element()}={value}" for value in parsed.sweep_string_iterator()])
        else:
            fixed.append(text)
    first = [values[0] for values in swept]
    runs = [fixed + first]
    for index, values in enumerate(swept):
        runs += [fixed + first[:index] + [value] + first[index + 1 :] for value in values[1:]]
    return runs


def _without_several_values(overrides: list[str]) -> list[str]:
    return [text for text in overrides if not parse_override(text).is_sweep_override()]


def _resume(path: Path) -> int:
    from forcegrasp.runs.run_dir import RunDir

    run = RunDir.open(path)
    config = run.config()
    (path / FAILURE).unlink(missing_ok=True)  # told when it failed; it gets another chance
    if run.has_checkpoint and run.load()[1]["frames"] >= config.algorithm.total_frames:
        print(f"{path}: already trained to the end ({config.algorithm.total_frames:,} frames)")
        return 0
    return _train(config, run, resume=True)


def _begin(config: TrainConfig, path: Path, overrides: list[str]) -> int:
    from forcegrasp.runs.run_dir import RunDir

    run = RunDir.create(path, config, overrides)
    print(f"run directory: {run.path}")
    return _train(config, run, resume=False)


def _train(config: TrainConfig, run: RunDir, resume: bool) -> int:
    try:
        from forcegrasp.train.board import evaluate_command
        from forcegrasp.train.loop import train

        done = train(config, run, resume)
    except KeyboardInterrupt:  # before the first batch, or typed twice
        print(f"interrupted; go on with: forcegrasp train resume={run.path}")
        return INTERRUPTED
    if done:
        print(f"trained. Compare it with the hand-written one: {evaluate_command(run, config)}")
        return 0
    print(f"stopped and saved; go on with: forcegrasp train resume={run.path}")
    return INTERRUPTED
