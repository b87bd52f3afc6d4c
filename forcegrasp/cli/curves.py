"""``forcegrasp curves``: learning curves of a sweep, or of any runs."""

from __future__ import annotations

from pathlib import Path

from forcegrasp.cli.verb import Verb
from forcegrasp.config.verbs import CurvesConfig
from forcegrasp.errors import ConfigError, writing

NOTES = """
  FOLDER     a sweep's folder, a run's, or any folder with runs below it; several are drawn together

Runs that differ in nothing but the seed become one curve: the mean of the finished ones, with its 95 % t-interval.
"""


def run(config: CurvesConfig) -> None:
    """Runs the verb."""
    folders = [Path(folder) for folder in config.folders]
    if not folders:
        raise ConfigError("which runs? forcegrasp curves runs/SWEEP")

    from forcegrasp.evaluate.curves import learning_curves

    out = Path(config.out) if config.out else folders[0]
    with writing(out):
        learning_curves(folders, out)


VERB = Verb(
    "curves",
    "draw the learning curves of a sweep, mean and interval over seeds",
    run=run,
    notes=NOTES,
    schema=CurvesConfig,
    positional=("folders", "FOLDER"),
)
