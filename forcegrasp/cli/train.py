"""``forcegrasp train``: one run, a sweep (-m), or the continuation of a run (resume=)."""

from __future__ import annotations

from pathlib import Path

from forcegrasp.cli.verb import Verb
from forcegrasp.config.verbs import TrainConfig
from forcegrasp.errors import ConfigError

NOTES = """
  -m / --multirun    run every combination of comma-separated values:
                     forcegrasp train -m experiment=ib,no_ib seed=0,1,2   (hydra/launcher=joblib: side by side)
                     forcegrasp train -m sweep=ablation                   the combinations of a preset
                     -m resume=FOLDER goes on with the sweep in that folder: what has ended stays
  resume=RUN_DIR     go on with an interrupted run, exactly as if it had not been interrupted
  hydra.run.dir=DIR  where to write the run; runs/TIME_EXPERIMENT_GRIPPER_MODEL_SEED by default

Watch a training with: tensorboard --logdir runs. Ctrl-C saves and ends; so do SIGTERM, SIGHUP and SIGUSR1.
"""


def run(arguments: list[str]) -> int:
    """Runs the verb; returns the exit status."""
    from forcegrasp.cli import one_training
    from forcegrasp.cli.resumed_sweep import RECORD, typed_again
    from forcegrasp.cli.sweep import sweep

    resume = [a for a in arguments if a.startswith("resume=")]
    multirun = [a for a in arguments if a in ("-m", "--multirun")]
    overrides = [a for a in arguments if a not in resume and a not in multirun]
    if resume:
        if resume[-1] == "resume=":
            raise ConfigError("resume= needs a run directory, as forcegrasp train printed it")
        folder = Path(resume[-1].partition("=")[2])
        if multirun and len(resume) == 1:
            return sweep(typed_again(folder, overrides))
        if overrides or len(resume) > 1:
            raise ConfigError(f"resume= goes on with the run's own configuration; drop {' '.join(overrides) or 'one'}")
        if (folder / RECORD).is_file():
            raise ConfigError(f"{folder} is a sweep's: go on with it by forcegrasp train -m resume={folder}")
        return one_training.resume(folder)
    return sweep(overrides) if multirun else one_training.train_one(overrides)


VERB = Verb(
    "train",
    "learn a grasp-force policy with PPO or SAC, or resume a run",
    run=run,
    notes=NOTES,
    schema=TrainConfig,
    multirun=True,
)
