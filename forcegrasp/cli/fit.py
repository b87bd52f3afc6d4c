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

    from forcegrasp.cli.measuring import (
        base_model,
        check_file,
        check_folder,
        refuse_table,
        tell_warnings,
        write_results,
    )
    from forcegrasp.identify import fit_set, loading
    from forcegrasp.models.model_file import write_model
    from forcegrasp.reports import fit as fit_report
    from forcegrasp.reports.next_step import after_fit

    folder = check_folder(default_out("fit", ""))
    path = check_file(folder / "model.yaml" if not config.out else need(config.out, "out", "model.yaml"))
    loaded = refuse_table(loading.load(folders), "fit")
    data = loaded.measured.path
    tell_warnings(loaded)
    target, _, base = fit_set.fit_model(loaded, config.seed, progress_printer())
    model = base_model(base, target, loaded)
    lead = fit_report.fit_answer(base, target)
    print_table(fit_report.printed_parameters(model))
    print("\n".join([lead, *(f"warning: {warning}" for warning in model.warnings)]))
    write_model(model, path)
    command = after_fit(data, path)
    print(f"wrote {path}\nnext: {command}")
    write_results(
        folder,
        "fit",
        fit_report.fit_json(base, target, model, loaded.measured.name, path),
        f"Base model of {loaded.measured.name}",
        fit_report.model_box(lead, model, [command]),
        fit_report.fit_sections(base, target, model),
        loaded,
    )


VERB = Verb(
    "fit",
    "fit a gripper's base model to measured grasps and write it as a file",
    run=run,
    notes=NOTES,
    schema=FitConfig,
    positional=("data", "SET"),
)
