"""``forcegrasp add``: a model with one more effect."""

from __future__ import annotations

import shlex

from forcegrasp.cli.results import default_out, need, need_sets, print_table, progress_printer
from forcegrasp.cli.verb import Verb
from forcegrasp.config.verbs import AddConfig

NOTES = """
  SET ...          the same as data=SET; several of one gripper are joined: 'data=[A,B]'
  data=my_set      the grasps to fit to
  model=FILE       what forcegrasp fit or add wrote
  effect=NAME      see forcegrasp effects; forcegrasp diagnose tells which
  effect=law.yaml  a formula: one that forcegrasp diagnose proposes, or your own
  out=better.yaml  is written if the error on held-out grasps falls; the report goes into runs/add_TIME
"""


def run(config: AddConfig) -> None:
    """Runs the verb."""
    folders = need_sets(config.data)
    old = need(config.model, "model", "model.yaml")
    need(config.effect, "effect", "backlash")

    from forcegrasp.cli.measuring import (
        check_effects,
        check_file,
        check_folder,
        effect_to_add,
        refuse_one_grasp,
        refuse_table,
        refuse_useless,
        take_model,
        tell_warnings,
        write_results,
    )
    from forcegrasp.diagnosis import add_effect
    from forcegrasp.identify import loading
    from forcegrasp.models.model_file import write_model
    from forcegrasp.reports import fit as fit_report
    from forcegrasp.reports.results import AddResult

    check_effects("effect", [config.effect])
    folder = check_folder(default_out("add", ""))
    path = check_file(folder / "model.yaml" if not config.out else need(config.out, "out", "better.yaml"))
    loaded = refuse_table(loading.load(folders), "add")
    data = loaded.measured.path
    refuse_one_grasp(loaded)
    effect = effect_to_add(config.effect, loaded.gripper)
    model, loaded = take_model(old, loaded)
    tell_warnings(loaded)
    added = add_effect.add_effect(loaded, model, effect, progress_printer())
    refuse_useless(added, effect, shlex.join(["forcegrasp", "diagnose", f"data={data}", f"model={old}"]))
    result = AddResult(loaded, added, effect, path)
    print_table(fit_report.printed_fall(added, effect))
    print_table(fit_report.printed_parameters(added.model))
    print("\n".join([result.answer, *(f"warning: {warning}" for warning in added.model.warnings)]))
    write_model(added.model, path)
    print(f"wrote {path}\nnext: {result.commands(folder)[0]}")
    write_results(folder, result)


VERB = Verb(
    "add",
    "add an effect to a model, fit it again, and see the error fall",
    run=run,
    notes=NOTES,
    schema=AddConfig,
    positional=("data", "SET"),
)
