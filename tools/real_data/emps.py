"""EMPS: fitted on the first file, judged on the pulses, whole recordings at a time, beside the authors' own model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.io import loadmat

from forcegrasp.models.model_file import read_model
from tools.real_data import emps_regression
from tools.real_data.emps_loop import GTAU, Carriage, simulate, velocity_delay
from tools.real_data.judge import best_model, whole
from tools.real_data.study import Error, Parameter, Study, checksums
from tools.real_data.verbs import Verbs

MINUTES = 6
#: Their offset is on the other side of the equation: a motor that pushes more, or a reading that is too low.
PUBLISHED = {
    "mass": 95.11, "damping": 203.5, "coulomb_friction.force_n": 20.39, "motor_offset.offset_n": 3.16,
    "force_bias.offset_n": -3.16,
}  # fmt: skip


def study(data: Path, out: Path) -> Study:
    """Imports both files, diagnoses the first, and judges what was found on the second."""
    verbs, folder = Verbs(out), data / "emps"
    fit = verbs.run("import_fit", "import", str(folder / "DATA_EMPS.mat"), "format=emps", makes="fit")
    check = verbs.run("import_check", "import", str(folder / "DATA_EMPS_PULSES.mat"), "format=emps", makes="check")
    found = verbs.diagnosis("diagnosis", fit)
    result = Study(
        "emps", "EMPS: a carriage on a ball screw",
        "the drive with its published gains; mass and viscous friction are fitted",
        "fitted on DATA_EMPS, judged on DATA_EMPS_PULSES, replayed from start to end",
        checksums(data, list(folder.glob("*.mat"))), seconds=verbs.seconds("import_fit", "import_check", "diagnosis"),
    )  # fmt: skip
    best = best_model(out / "diagnosis")
    model = read_model(best)
    for name, p in model.base.items():
        more = float(model.gripper.compile().body_mass.sum()) if name == "mass" else 0.0  # what the scene has of it
        result.parameters.append(
            Parameter(name, p.value + more, p.low + more, p.high + more, p.unit, PUBLISHED.get(name))
        )
    result.take_diagnosis(found, PUBLISHED)
    before, after = (errors(check, file) for file in (out / "diagnosis" / "base_model.yaml", best))
    yard = yardsticks(folder / "DATA_EMPS_PULSES.mat")
    for k, (signal, unit, scale) in enumerate((("position", "µm", 1e6), ("force", "N", 1.0))):
        noise = noise_of(model)[k] * scale
        published = yard[0][1:][k] * scale
        result.errors.append(Error(signal, unit, before[k] * scale, after[k] * scale, noise, published))
    own = [("what was found", *after)]
    if "velocity_lag" not in result.found:
        late = verbs.run("add", "add", f"data={fit}", f"model={best}", "effect=velocity_lag", makes="late.yaml")
        lag = read_model(late).effects[-1].parameters["lag_s"].value
        own.append((f"and `velocity_lag`, {1e3 * lag:.1f} ms", *errors(check, late)))
    result.commands = [" ".join(step["command"]) for step in verbs.done.values()]
    result.tables["On the pulses"] = [["model", "position [µm]", "force [N]"]] + [
        [name, f"{1e6 * q:.2f}", f"{f:.2f}"] for name, q, f in own + yard
    ]
    recordings = {file: read(folder / f"{file}.mat") for file in ("DATA_EMPS", "DATA_EMPS_PULSES")}
    result.tables["The force by regression, without a simulation"] = emps_regression.table(recordings)
    for file, raw in recordings.items():
        a, b, late = velocity_delay(raw["qm"], raw["qg"], raw["vir"] - raw.get("pulses_N", 0.0))
        result.notes.append(
            f"{file}: the drive's voltage is {a:.3f} kp·kv times its position error and {b:.3f} kv times a"
            f" velocity that is {1e3 * late:.2f} ms late"
        )
    return result


def noise_of(model) -> tuple[float, float]:
    """Noise of positions and forces that a model file holds."""
    return model.noise if model.noise else (float("nan"), float("nan"))


def read(file: Path) -> dict[str, np.ndarray]:
    """The signals of a file."""
    return {k: np.asarray(v, float).ravel() for k, v in loadmat(file).items() if not k.startswith("__")}


def errors(check: Path, model: Path) -> tuple[float, float]:
    """Root mean square of position (m) and force (N) over the whole recording."""
    ((_, measured, predicted),) = whole(check, model)
    left = measured - predicted
    return float(np.sqrt(np.mean(left[:, 0] ** 2))), float(np.sqrt(np.mean(left[1:, 1] ** 2)))


def yardsticks(file: Path) -> list[tuple[str, float, float]]:
    """The same of the authors' model: its name, position (m) and force (N)."""
    raw = read(file)
    pulses = raw.get("pulses_N", np.zeros_like(raw["qm"]))
    found = []
    velocities = ("the drive's own velocity", "its difference over 1 ms", "its difference over 2 ms")
    for late, name in enumerate(f"the authors', with {velocity}" for velocity in velocities):
        simulated = simulate(Carriage(), raw["qg"], pulses, raw["qm"][0], late)
        left = simulated - np.column_stack([raw["qm"], raw["vir"] - pulses])
        position, volts = np.sqrt(np.mean(left**2, axis=0))
        found.append((name, float(position), float(GTAU * volts)))
    return found
