"""Runs stages one after another, each from where it was left."""

from __future__ import annotations

import shlex
import subprocess
from collections.abc import Callable, Iterable

from tools.measured_code import ROOT
from tools.results.notes import Notes, State
from tools.results.stage import Stage, ready_to_run

#: Exit status of a program that saved and ended at Ctrl-C.
INTERRUPTED = 130


def carry_out(stages: Iterable[Stage], notes: Notes, redo: bool, say: Callable[[str], None]) -> int:
    """Runs what is not done; returns the exit status, 0 if nothing is left.

    Args:
      redo: begin anew what is outdated; it is told and left as it is otherwise.
    """
    left = 0
    for stage in stages:
        state, why = notes.state(stage)
        if state is State.OUTDATED and redo:
            notes.forget(stage)
            state = State.TO_DO
        if state is State.DONE:
            continue
        if state is State.OUTDATED:
            say(f"{stage.name}: made {why}, and left as it is; --redo outdated makes it anew")
            left = 1
            continue
        if waiting := [name for name in stage.needs if notes.ended(name) is None]:
            say(f"{stage.name}: waits for {', '.join(waiting)}")
            left = 1
            continue
        if status := _run(stage, notes, say):
            how = "stopped" if status == INTERRUPTED else f"failed (exit status {status})"
            say(f"{stage.name}: {how}; the same command goes on from here")
            return status
    return left


def _run(stage: Stage, notes: Notes, say: Callable[[str], None]) -> int:
    note = notes.begin(stage)
    for command in stage.commands[note.done :]:
        say(f"{stage.name}: {shlex.join(command)}")
        try:
            status = run_command(ready_to_run(command))
        except KeyboardInterrupt:
            status = INTERRUPTED
        if status:
            return status
        notes.command_ended(stage, note)
    return 0


def run_command(words: list[str]) -> int:
    """Runs it in the repository; at Ctrl-C waits until it has saved."""
    with subprocess.Popen(words, cwd=ROOT) as process:
        while True:
            try:
                return process.wait()
            except KeyboardInterrupt:
                continue
