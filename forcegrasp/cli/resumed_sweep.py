"""A sweep that is in a folder already, as it was typed: Hydra keeps that in ``multirun.yaml``."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from forcegrasp.cli.spelling import quote
from forcegrasp.errors import ConfigError
from forcegrasp.files import plain_yaml

#: What tells the folder of a sweep.
RECORD = "multirun.yaml"
#: What is typed of Hydra's options, besides folders. What one launcher has is of no use to another: it goes with it.
_OF_LAUNCHER = ("hydra/launcher", "hydra.launcher.")


def typed_again(folder: Path, given: list[str]) -> list[str]:
    """The command line that goes on with a sweep: what it was begun with, but for what is given in its place.

    Raises:
      ConfigError: if there is no sweep in the folder.
    """
    record = folder / RECORD
    try:
        begun = plain_yaml.load(record)["hydra"]["overrides"]
        of_hydra = [text for text in map(str, begun["hydra"]) if text.startswith(_OF_LAUNCHER)]
        before = [*map(str, begun["task"]), *of_hydra]
    except FileNotFoundError as error:
        raise ConfigError(f"{folder}: no sweep is there (no {RECORD}); a single run is resumed without -m") from error
    except (OSError, plain_yaml.PlainYamlError, KeyError, TypeError) as error:
        raise ConfigError(f"{record}: not what a sweep leaves there; type the sweep again, with its folder") from error
    replaced = _keys(given)
    if any(key.startswith(_OF_LAUNCHER) for key in replaced):
        replaced |= {key for key in _keys(before) if key.startswith(_OF_LAUNCHER)}
    kept = [text for text in before if not _keys([text]) & replaced]
    return [*kept, *given, f"hydra.sweep.dir={quote(str(folder))}"]


def _keys(overrides: Iterable[str]) -> set[str]:
    return {text.partition("=")[0] for text in overrides}
