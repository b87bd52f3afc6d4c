"""``forcegrasp diagnose``: which physical effect a model lacks."""

from __future__ import annotations

from pathlib import Path

from forcegrasp.cli.options import compose, help_text
from forcegrasp.cli.results import default_out, narrator, need

PURPOSE = "find out which physical effect a model lacks, and which grasp to record next"
NOTES = """
  data=my_set      a folder with meta.yaml, grasps.csv and samples.csv (or samples.parquet); or, for a table of final
                   forces, with meta.yaml and table.csv
  model=FILE       what forcegrasp fit or add wrote; its parameters are fitted again
  'effects=[A,B]'  see forcegrasp effects

  The verdict is one of: effect (one or several, in the order found), one_of (these data can't tell which), explained
  (nothing is missing), unknown (none of the effects), not_fitted (the base model can't be fitted to these data).
  If effects are found, model.yaml beside the report holds the model with all of them (with one_of: with the first).
"""


def main(arguments: list[str]) -> int:
    """Runs the verb; returns the exit status."""
    if any(a in ("-h", "--help") for a in arguments):
        print(help_text("diagnose", PURPOSE, NOTES), end="")
        return 0
    config = compose("diagnose", arguments)
    data = need(config.data, "data", "my_set")

    from rich.console import Console

    from forcegrasp.cli.measuring import (
        check_effects,
        check_folder,
        is_table,
        report_table,
        tell_warnings,
        write_results,
    )
    from forcegrasp.compare import diagnose_output, workflow
    from forcegrasp.compare.advice import advise
    from forcegrasp.effects import catalogue
    from forcegrasp.effects.model_file import read_model, write_model

    tried = check_effects("effects", config.effects) or list(catalogue().values())
    out = check_folder(default_out("diagnose", config.out))
    loaded = workflow.load(data)
    if is_table(loaded):
        report_table(loaded, "diagnosis", out, model=config.model, effects=config.effects)
        return 0
    model = read_model(Path(config.model)) if config.model else None
    tell_warnings(loaded)
    diagnosis, _ = workflow.diagnose_set(loaded, model, [e.name for e in tried], config.seed, narrator())
    advice = advise(diagnosis)
    lead, table = diagnose_output.answer(diagnosis), diagnose_output.printed(diagnosis)
    if config.effects:
        lead += f" Only {', '.join(config.effects)} were tried."
    if table is not None:
        Console(highlight=False).print(table)
    print("\n".join([f"{diagnosis.verdict}: {lead}", *diagnose_output.lines(diagnosis, advice)]))
    if diagnosis.verdict in ("effect", "one_of"):
        known = config.model or "model.yaml"
        print(f"add it: forcegrasp add data={data} model={known} effect={diagnosis.effects[0]} out=better.yaml")
        better = workflow.model_of(diagnosis.fit, diagnosis.target, loaded, diagnosis.numerical)
        write_model(better, out / "model.yaml")
        print(f"or take the model with {', '.join(e.effect.name for e in better.effects)}: {out / 'model.yaml'}")
    write_results(
        out,
        "diagnosis",
        diagnose_output.diagnosis_json(diagnosis, advice, tried, loaded.measured.name),
        f"What the model lacks: {loaded.measured.name}",
        lead,
        diagnose_output.sections(diagnosis, advice, tried),
        loaded,
    )
    return 0
