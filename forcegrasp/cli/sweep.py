"""Several trainings: every combination of the values that are given, one after another or side by side."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, cast

from forcegrasp.cli import run_name
from forcegrasp.cli.one_training import FAILURE, INTERRUPTED, begin_or_resume, check
from forcegrasp.cli.options import compose, compose_sweep, groups, parse_override, spell_sweep, with_value
from forcegrasp.cli.spelling import quote
from forcegrasp.errors import ConfigError, ForcegraspError

if TYPE_CHECKING:
    from forcegrasp.config import TrainConfig

#: One of a sweep's runs that train side by side was stopped: no further one begins.
STOPPED = "stopped"
run_name.register()  # a launcher's process imports this module, and names its run


def sweep(overrides: list[str]) -> int:
    """Trains every combination; returns the exit status, and raises ForcegraspError if runs failed."""
    if preset := next((o for o in overrides if o.startswith("sweep=") and "," in o), ""):
        raise ConfigError(f"{preset}: one preset at a time")
    overrides = spell_sweep("train", overrides)
    launcher = next((o for o in overrides if o.startswith("hydra/launcher=submitit_")), "")
    if launcher and not find_spec("hydra_plugins.hydra_submitit_launcher"):
        raise ConfigError(f"{launcher} needs an extra: pip install 'forcegrasp[cluster]'")
    _check_each(single_runs(overrides))  # refuses bad input before anything is written
    _, folder = compose_sweep(_without_several_values(overrides))
    import hydra
    from hydra.core.global_hydra import GlobalHydra
    from omegaconf import DictConfig

    GlobalHydra.instance().clear()
    os.environ["HYDRA_FULL_ERROR"] = "1"  # exceptions reach the caller, who says it in one line

    @hydra.main(version_base="1.3", config_path="pkg://forcegrasp.conf", config_name="train")
    def job(composed: DictConfig) -> int:
        return _job(composed)

    sys.argv = ["forcegrasp train", "-m", *overrides, f"hydra.sweep.dir={quote(folder)}"]
    if not any(text.startswith("hydra/launcher=") for text in overrides):
        sys.argv.append("hydra.sweeper.max_batch_size=1")  # else Hydra composes all runs before it begins the first
    from forcegrasp.runs.lock import only_writer

    try:
        with only_writer(Path(folder) / "sweep.lock"):
            if launcher:
                print(f"the runs' jobs write to {folder}/.submitit")
            try:
                _side_by_side(job, Path(folder) / STOPPED) if "hydra/launcher=joblib" in overrides else job()
            finally:  # a sweep that was cut short has something to show, too
                _draw_curves(Path(folder))
    except KeyboardInterrupt:
        print(f"go on with: {_go_on(folder)}")
        raise
    except Exception as error:
        if type(error).__module__.startswith("submitit."):
            reason = " ".join(str(error).splitlines()[:2])
            raise ForcegraspError(f"{reason}; go on with: {_go_on(folder)}") from error
        raise
    return _tell_failures(sorted(Path(folder).rglob(FAILURE)))


def _go_on(folder: Path | str) -> str:
    return f"forcegrasp train -m resume={folder}"


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


def _job(composed) -> int:
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
        status = begin_or_resume(path, config, overrides)
    except (ForcegraspError, OSError) as error:  # raised here, Hydra would tell of the first one alone
        (path / FAILURE).write_text(f"{error}\n", "utf-8")
        return 2
    (path / FAILURE).unlink(missing_ok=True)  # of another job that found this one at work
    if status == INTERRUPTED:
        if launcher.startswith("submitit_"):  # a scheduler ended this job alone
            raise ForcegraspError(f"{path}: stopped and saved; go on with: {_go_on(hydra.sweep.dir)}")
        if launcher == "joblib":  # which would kill the others before they have saved
            stopped.touch()
            return INTERRUPTED
        raise KeyboardInterrupt  # ends the sweep, not just this run
    return status


def _check_each(runs: list[list[str]]) -> None:
    """Raises ConfigError if one of a sweep's values is of no use."""
    first = compose("train", runs[0])
    check(first)
    for single in runs[1:]:
        for changed in set(single) - set(runs[0]):
            key = changed.partition("=")[0]
            plain = key not in groups("train") and not key.startswith("hydra")
            check(with_value(first, changed) if plain else compose("train", single))


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
