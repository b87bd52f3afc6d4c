"""``forcegrasp fit``: a gripper's base model from measurements."""

from __future__ import annotations

from forcegrasp.cli.results import default_out, need, need_sets, print_table, progress_printer
from forcegrasp.cli.verb import Verb
from forcegrasp.config.verbs import FitConfig

NOTES = """
  SET ...          the same as data=SET; several of one gripper are joined: 'data=[A,B]'
  data=my_set      a folder with meta.yaml, grasps.csv and samples.csv (or samples.parquet)
  out=model.yaml   text that may be edited: values with 95 % intervals; the report goes into runs/fit_TIME
"""


def run(config: FitConfig) -> None:
    """Runs the verb."""
    folders = need_sets(config.data)

    from forcegrasp.cli.measuring import check_file, check_folder, refuse_table, tell_warnings, write_results
    from forcegrasp.identify import fit_set, loading
    from forcegrasp.models.model_file import write_model
    from forcegrasp.reports import fit as fit_report
    from forcegrasp.reports.results import FitResult, base_model

    folder = check_folder(default_out("fit", ""))
    path = check_file(folder / "model.yaml" if not config.out else need(config.out, "out", "model.yaml"))
    loaded = refuse_table(loading.load(folders), "fit")
    tell_warnings(loaded)
    target, _, base = fit_set.fit_model(loaded, config.seed, progress_printer())
    result = FitResult(loaded, target, base, base_model(base, target, loaded), path)
    print_table(fit_report.printed_parameters(result.model))
    print("\n".join([result.answer, *(f"warning: {warning}" for warning in result.model.warnings)]))
    write_model(result.model, path)
    print(f"wrote {path}\nnext: {result.commands(folder)[0]}")
    write_results(folder, result)


VERB = Verb(
    "fit",
    "fit a gripper's base model to measured grasps and write it as a file",
    run=run,
    notes=NOTES,
    schema=FitConfig,
    positional=("data", "SET"),
)
