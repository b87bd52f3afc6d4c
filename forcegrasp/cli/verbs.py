"""Every verb of the command line."""

from __future__ import annotations

import importlib

from forcegrasp.cli.verb import Verb

#: Files of this folder, in the order of the help.
_FILES = (
    *("record", "import", "compare", "fit", "diagnose", "add"),
    *("train", "evaluate", "curves", "export", "render", "robot"),
    *("effects", "doctor", "completion"),
)
VERBS: dict[str, Verb] = {name: importlib.import_module(f"forcegrasp.cli.{name}").VERB for name in _FILES}
