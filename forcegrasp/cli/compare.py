"""``forcegrasp compare``: where a model fails."""

from __future__ import annotations

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

    from forcegrasp.cli.measuring import check_folder, is_table, report_table, take_model, tell_warnings, write_results
    from forcegrasp.identify import comparison, loading
    from forcegrasp.reports import between_sets
    from forcegrasp.reports import comparison as comparison_report
    from forcegrasp.reports.results import BASE_MODEL, CompareResult

    out = check_folder(default_out("compare", config.out))
    loaded = loading.load(folders)
    if is_table(loaded):
        report_table(loaded, "compare", out, model=config.model)
        return
    model, loaded = take_model(Path(config.model), loaded) if config.model else (None, loaded)
    tell_warnings(loaded)
    found, used, notes = comparison.compare(loaded, model, config.seed, progress_printer())
    result = CompareResult(loaded, found, used, config.model, (*notes, *used.warnings), config.model)
    print_table(comparison_report.printed(found))
    print("\n".join([result.answer, *comparison_report.details(found), *(f"note: {note}" for note in result.notes)]))
    if found.between is not None:
        print_table(between_sets.printed(found.between))
    result.write_beside(out)
    if model is None:
        print(f"wrote {out / BASE_MODEL}: the base model, fitted to this set")
    for command in result.commands(out)[:1]:
        print(f"next: {command}")
    write_results(out, result)


VERB = Verb(
    "compare",
    "show where a model fails on measured grasps, in units and as a multiple of the sensor noise",
    run=run,
    notes=NOTES,
    schema=CompareConfig,
    positional=("data", "SET"),
)
