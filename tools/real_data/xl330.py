"""The XL330 with a pendulum: one model for all kp and trajectories, beside the authors' M1 … M6 on the same split."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from forcegrasp.models.model_file import read_model
from tools.real_data.bam_models import fit_all, read_logs, rms
from tools.real_data.judge import add_base, best_model, fit_with, whole, windows
from tools.real_data.study import Error, Study, checksums
from tools.real_data.verbs import Verbs

MINUTES = 30
#: Logs that nothing is fitted to: both of kp 200, and the fastest trajectory at kp 400.
JUDGED = ("10h28m49", "10h28m57", "10h29m14")
#: Members of the friction family that are compared one by one.
FAMILY = (("coulomb_friction",), ("stiction",), ("load_friction",), ("stiction", "load_friction"))


def study(data: Path, out: Path) -> Study:
    """Imports all logs, diagnoses those that are fitted, and judges on the others, replayed from start to end."""
    verbs, folder = Verbs(out), data / "xl330"
    files = sorted(folder.glob("*.json"))
    check = [f for f in files if f.stem.endswith(JUDGED)]
    sets = {
        name: verbs.run(f"import_{name}", "import", *map(str, chosen), "format=bam", makes=name)
        for name, chosen in (("fit", [f for f in files if f not in check]), ("check", check))
    }
    found = verbs.diagnosis("diagnosis", sets["fit"])
    result = Study(
        "xl330", "A Dynamixel XL330 with a pendulum", "gain per kp, damping, armature and read-out skew are fitted",
        f"fitted on {len(files) - len(check)} logs, judged on {', '.join(f.stem for f in check)}, from start to end",
        checksums(data, files),
    )  # fmt: skip
    base, best = out / "diagnosis" / "base_model.yaml", best_model(out / "diagnosis")
    add_base(result, read_model(best), {})
    result.take_diagnosis(found)
    noise = 1e3 * float(windows(sets["check"], base).sigma[0])
    before, after = (1e3 * left(sets["check"], file) for file in (base, best))
    result.errors.append(Error("position", "mrad", before, after, noise))
    family = [["friction", "position held out [mrad]", "parameters [95 %]"]]
    family.append(["none", f"{before:.1f}", ""])
    for names in FAMILY:
        file = out / f"{'_and_'.join(names)}.yaml"
        fitted = [
            f"{effect.effect.name}.{key} {p.value:.3g} [{p.low:.3g}, {p.high:.3g}] {p.unit}"
            for effect in fit_with(sets["fit"], base, names, file).effects
            if effect.effect.name in names
            for key, p in effect.parameters.items()
        ]
        family.append([", ".join(names), f"{1e3 * left(sets['check'], file):.1f}", "; ".join(fitted)])
    family.append(["all that was found", f"{after:.1f}", ", ".join(result.found)])
    result.tables["One member of the friction family at a time, added to the base model"] = family
    result.tables["The authors' models, fitted here on the same logs"] = _yardsticks(files, check, out)
    result.commands, result.seconds = [" ".join(s["command"]) for s in verbs.done.values()], verbs.seconds()
    return result


def left(measured: Path, model: Path) -> float:
    """Root mean square of the positions of whole logs, rad."""
    errors = [(seen - predicted)[:, 0] for _, seen, predicted in whole(measured, model)]
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def _yardsticks(files: list[Path], check: list[Path], out: Path) -> list[list[str]]:
    logs = read_logs({f.stem: json.loads(f.read_text()) for f in files})
    judged = logs.chosen([f.stem for f in check])
    fit = logs.chosen([f.stem for f in files if f not in check])
    kept = out / "bam_models.json"
    if not kept.is_file():
        print("  fitting M1 to M6", flush=True)
        kept.write_text(json.dumps(fit_all(fit), indent=1))
    rows = [["model", "parameters", "fitted [mrad]", "held out [mrad]"]]
    for name, values in json.loads(kept.read_text()).items():
        errors = (f"{1e3 * rms(name, values, part):.1f}" for part in (fit, judged))
        rows.append([name, str(len(values)), *errors])
    return rows
