"""What was done, with which code: a file for each stage, written as soon as a command of it ends."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path

from forcegrasp.files.whole_file import write_whole
from forcegrasp.runs.provenance import git_hash
from tools.measured_code import ROOT, STAMP, sentence
from tools.results.settings import digests
from tools.results.stage import Stage

#: What the names of stages begin with that put a policy into the package.
SHIP = "ship-"
# When a stage has ended whose policy came with the package.
_IN_PACKAGE = "in the package"


class State(StrEnum):
    """How far a stage is."""

    DONE = "done"
    BEGUN = "begun"
    OUTDATED = "outdated"
    TO_DO = "to do"


@dataclass
class Note:
    """Of one stage: its commands, how many of them have ended, and the code that they began with."""

    commands: list[list[str]]
    needs: dict[str, str]  #: stages that it was made of → when they had ended
    commit: str
    digest: str
    done: int = 0
    ended: str = ""


class Notes:
    """The notes in a folder of results."""

    def __init__(self, out: Path) -> None:
        self.out = out
        self._now = digests()

    def read(self, name: str) -> Note | None:
        """What is known of a stage."""
        path = self._path(name)
        return Note(**json.loads(path.read_text("utf-8"))) if path.is_file() else None

    def ended(self, name: str) -> Note | None:
        """The note of a stage that has ended; of a policy that was shipped elsewhere, what its card says."""
        note = self.read(name)
        if note is None and name.startswith(SHIP):
            return _of_card(ROOT / "forcegrasp" / "policies" / name.removeprefix(SHIP) / "card.md")
        return note if note and note.ended else None

    def state(self, stage: Stage) -> tuple[State, str]:
        """How far it is, and why it is outdated."""
        note = self.read(stage.name)
        if note is None:
            return State.TO_DO, ""
        if note.commands != [list(command) for command in stage.commands]:
            return State.OUTDATED, "by other commands"
        if note.digest != self._now[stage.code]:
            return State.OUTDATED, "with other code"
        if anew := [name for name, ended in note.needs.items() if ended != self._when_ended(name)]:
            return State.OUTDATED, f"before {', '.join(anew)}"
        return (State.DONE if note.ended else State.BEGUN), ""

    def behind(self, names: Iterable[str]) -> list[Note] | None:
        """The notes of stages and of all that they were made of; None unless all of these have ended."""
        found: dict[str, Note] = {}
        ahead = list(names)
        for name in ahead:  # grows as it is gone through
            note = self.ended(name)
            if note is None:
                return None
            found[name] = note
            ahead += [need for need in note.needs if need not in ahead]
        return list(found.values())

    def begin(self, stage: Stage) -> Note:
        """The note of a stage that is begun, or gone on with."""
        note = self.read(stage.name)
        if note is None:
            needs = {name: self._when_ended(name) for name in stage.needs}
            commands = [list(command) for command in stage.commands]
            note = Note(commands, needs, git_hash() or "none", self._now[stage.code])
            self._write(stage.name, note)
        return note

    def command_ended(self, stage: Stage, note: Note) -> None:
        """Counts a command of it."""
        note.done += 1
        if note.done == len(note.commands):
            note.ended = datetime.now(UTC).isoformat()
        self._write(stage.name, note)

    def forget(self, stage: Stage) -> None:
        """Removes what a stage has left, to begin it anew."""
        shutil.rmtree(self.out / stage.name, ignore_errors=True)
        self._path(stage.name).unlink(missing_ok=True)

    def _when_ended(self, name: str) -> str:
        note = self.read(name)
        return note.ended if note else ""

    def _path(self, name: str) -> Path:
        return self.out / "notes" / f"{name}.json"

    def _write(self, name: str, note: Note) -> None:
        self._path(name).parent.mkdir(parents=True, exist_ok=True)
        write_whole(self._path(name), (json.dumps(asdict(note), indent=1) + "\n").encode())


def _of_card(card: Path) -> Note | None:
    found = STAMP.search(card.read_text("utf-8")) if card.is_file() else None
    return Note([], {}, found[1], found[2], ended=_IN_PACKAGE) if found else None


def stamps(made: list[Note], name: str, more: str = "") -> list[str]:
    """For a page or a card: a sentence for each state of the code that took part, and the command to do it again."""
    first = {note.digest: note for note in reversed(made)}
    how = f"`python -m tools.results --only {name}`{more}"
    return [
        sentence(note.commit, digest, "policies that are shown" if note.ended == _IN_PACKAGE else how)
        for digest, note in reversed(first.items())
    ]
