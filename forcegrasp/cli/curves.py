"""``forcegrasp curves``: learning curves of a sweep, or of any runs."""

from __future__ import annotations

from pathlib import Path

from forcegrasp.cli.options import compose, help_text
from forcegrasp.errors import ConfigError

PURPOSE = "draw the learning curves of a sweep, mean and interval over seeds"
NOTES = """
  FOLDER     a sweep's folder, a run's, or any folder with runs below it; several are drawn together

Runs that differ in nothing but the seed become one curve: the mean of the finished ones, with its 95 % t-interval.
"""


def main(arguments: list[str]) -> int:
    """Runs the verb; returns the exit status."""
    if any(a in ("-h", "--help") for a in arguments):
        print(help_text("curves", PURPOSE, NOTES, "FOLDER ..."), end="")
        return 0
    config = compose("curves", arguments)
    folders = [Path(folder) for folder in config.folders]
    if not folders:
        raise ConfigError("which runs? forcegrasp curves runs/SWEEP")

    from forcegrasp.evaluate.curves import learning_curves

    out = Path(config.out) if config.out else folders[0]
    try:
        learning_curves(folders, out)
    except OSError as error:
        raise ConfigError(f"out={out}: could not write ({error.strerror})") from error
    return 0
