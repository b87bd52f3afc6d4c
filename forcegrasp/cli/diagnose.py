"""``forcegrasp diagnose``: which physical effect a model lacks."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from forcegrasp.cli.results import default_out, need_sets, print_table, progress_printer
from forcegrasp.cli.verb import Verb
from forcegrasp.config.verbs import DiagnoseConfig

NOTES = """
  SET ...          the same as data=SET; several of one gripper are joined: 'data=[A,B]'
  data=my_set      a folder with meta.yaml, grasps.csv and samples.csv (or samples.parquet); or, for a table of final
                   forces, with meta.yaml and table.csv
  model=FILE       what forcegrasp fit or add wrote; its parameters are fitted again
  'effects=[A,B]'  see forcegrasp effects
  minutes=10       a set with many effects may take longer; Ctrl-C ends it, too. What was found by then is told and
                   written, and the way to go on from there

  The verdict is one of: effect (one or several, in the order found), one_of (these data can't tell which), data (the
  set seems to be wrong, not the model), explained (nothing is missing), unknown (none of the effects), not_fitted (the
  base model can't be fitted to these data).
  Beside the report, base_model.yaml holds the base model that was fitted, if none is given; if effects are found,
  model.yaml holds the model with all of them (with one_of: with the first); if another grasp would tell effects
  apart, next_grasp.csv holds its commands. With law=true, and where a formula explains what no effect does, law.yaml
  holds that: forcegrasp add takes it as an effect.
"""


def run(config: DiagnoseConfig) -> int:
    """Runs the verb; returns the exit status."""
    folders = need_sets(config.data)

    from forcegrasp.cli.measuring import (
        check_effects,
        check_folder,
        is_table,
        report_table,
        take_model,
        tell_warnings,
        write_results,
    )
    from forcegrasp.diagnosis import diagnose_set
    from forcegrasp.diagnosis.advice import advise
    from forcegrasp.diagnosis.cut_short import INTERRUPTED
    from forcegrasp.identify import loading
    from forcegrasp.replay.time_limit import time_limit
    from forcegrasp.reports import diagnosis as diagnosis_report
    from forcegrasp.reports.next_step import next_grasp_words
    from forcegrasp.reports.results import BASE_MODEL, FOUND_MODEL, NEXT_GRASP, PROPOSED_LAW, DiagnoseResult

    check_effects("effects", config.effects)
    out = check_folder(default_out("diagnose", config.out))
    loaded = loading.load(folders)
    if is_table(loaded):
        report_table(loaded, "diagnosis", out, model=config.model, effects=config.effects)
        return 0
    tried = diagnose_set.chosen_effects(loaded.gripper, config.effects)
    model, loaded = take_model(Path(config.model), loaded) if config.model else (None, loaded)
    tell_warnings(loaded)
    names, progress = [e.name for e in tried], progress_printer()
    with time_limit(config.minutes), sigterm_as_ctrl_c():
        diagnosis, _ = diagnose_set.diagnose_set(loaded, model, names, config.seed, progress, law=config.law)
    advice = advise(diagnosis)
    result = DiagnoseResult(loaded, diagnosis, advice, tuple(tried), tuple(config.effects), config.model)
    if (table := diagnosis_report.printed(diagnosis)) is not None:
        print_table(table)
    print("\n".join([f"{diagnosis.verdict}: {result.answer}", *diagnosis_report.lines(diagnosis, advice)]))
    result.write_beside(out)
    known, found = config.model or out / BASE_MODEL, out / FOUND_MODEL
    if model is None:
        print(f"wrote {known}: the base model, fitted to this set")
    if diagnosis.verdict.lacks_effects:
        print(f"wrote {found}: the model with {', '.join(e.effect.name for e in result.model.effects)}")
    if advice is not None:
        print(f"wrote {out / NEXT_GRASP}: {next_grasp_words(loaded.measured, out / 'diagnosis.json')}")
    if diagnosis.law is not None:
        print(f"wrote {out / PROPOSED_LAW}: the law, to name, edit and add")
    print("\n".join(f"{'or' if k else 'next'}: {command}" for k, command in enumerate(result.commands(out))))
    write_results(out, result)
    return 130 if diagnosis.stopped == INTERRUPTED else 0


@contextmanager
def sigterm_as_ctrl_c() -> Iterator[None]:
    """Lets a scheduler, or ``timeout``, end what it began as a person would."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    try:
        before = signal.signal(signal.SIGTERM, interrupt)
    except ValueError:  # not the main thread
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


VERB = Verb(
    "diagnose",
    "find out which physical effect a model lacks, and which grasp to record next",
    run=run,
    notes=NOTES,
    schema=DiagnoseConfig,
    positional=("data", "SET"),
)
