"""What a verb of the command line is: its help, errors, completion and page of options follow from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any


@dataclass(frozen=True)
class Verb:
    """One verb: a file of this folder has it as ``VERB``.

    ``run`` gets the checked options, a ``schema``, and returns the exit status (None: 0). A verb without a schema, and
    one with ``multirun``, gets the arguments as typed. Nothing heavy is imported before ``run``.
    """

    name: str  #: as it is typed, and the name of its file
    purpose: str  #: a line, for the list of verbs
    run: Callable[[Any], int | None]
    notes: str = ""  #: what its help says below the usage
    schema: type | None = None  #: dataclass of its options, see forcegrasp/config/verbs.py
    positional: tuple[str, str] = ("", "")  #: the option that may be given without ``key=``, and a word for its value
    usage: str = ""  #: what else may follow it, if not options of a schema
    multirun: bool = False  #: whether it takes ``-m`` and options of Hydra's own
    needs_mujoco: bool = True

    @property
    def reads_arguments(self) -> bool:
        """Whether ``run`` gets the arguments as they are typed, not options."""
        return self.schema is None or self.multirun

    @property
    def usage_line(self) -> str:
        """How it is called."""
        option, word = self.positional
        several = any(f.name == option and "list" in str(f.type) for f in fields(self.schema)) if self.schema else False
        words = [f"[{word}{' ...' * several}]"] if word else []
        options = "[key=value ...]" if self.schema else self.usage
        return " ".join(filter(None, ["usage: forcegrasp", self.name, *words, options]))
