"""``forcegrasp compare``: where a model fails."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from forcegrasp.cli.results import default_out, need_sets, print_table, progress_printer
from forcegrasp.cli.verb import Verb
from forcegrasp.config.verbs import CompareConfig

NOTES = """
  SET ...          the same as data=SET; several of one gripper are joined, and told apart: 'data=[A,B]'
  data=my_set      a folder with meta.yaml, grasps.csv and samples.csv (or samples.parquet); or, for a table of final
                   forces, with meta.yaml and table.csv
  model=FILE       what forcegrasp fit or add wrote; a model that was fitted to other grasps is tested on all of these
"""


def run(config: CompareConfig) -> None:
    """Runs the verb."""
    folders = need_sets(config.data)

    from forcegrasp.cli.measuring import (
        BASE_MODEL,
        check_folder,
        is_table,
        report_table,
        take_model,
        tell_warnings,
        write_results,
    )
    from forcegrasp.identify import comparison, loading
    from forcegrasp.models.model_file import write_model
    from forcegrasp.reports import between_sets
    from forcegrasp.reports import comparison as comparison_report
    from forcegrasp.reports.next_step import after_comparison

    out = check_folder(default_out("compare", config.out))
    loaded = loading.load(folders)
    data = loaded.measured.path
    if is_table(loaded):
        report_table(loaded, "compare", out, model=config.model)
        return
    model, loaded = take_model(Path(config.model), loaded) if config.model else (None, loaded)
    tell_warnings(loaded)
    found, used, notes = comparison.compare(loaded, model, config.seed, progress_printer())
    notes, name = [*notes, *used.warnings], config.model or "base model, fitted to this set"
    lead = comparison_report.answer(found)
    print_table(comparison_report.printed(found))
    print("\n".join([lead, *comparison_report.details(found), *(f"note: {note}" for note in notes)]))
    if found.between is not None:
        print_table(between_sets.printed(found.between))
    if model is None:
        write_model(dataclasses.replace(used, warnings=tuple(notes)), out / BASE_MODEL)
        print(f"wrote {out / BASE_MODEL}: the base model, fitted to this set")
    commands = after_comparison(found, data, config.model or out / BASE_MODEL)
    print(f"next: {commands[0]}")
    write_results(
        out,
        "compare",
        comparison_report.compare_json(found, loaded.measured.name, name, notes),
        f"Where the model fails: {loaded.measured.name}",
        comparison_report.answer_box(found, notes, commands),
        comparison_report.sections(found, notes),
        loaded,
    )


VERB = Verb(
    "compare",
    "show where a model fails on measured grasps, in units and as a multiple of the sensor noise",
    run=run,
    notes=NOTES,
    schema=CompareConfig,
    positional=("data", "SET"),
)
