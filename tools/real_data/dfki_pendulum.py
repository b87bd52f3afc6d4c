"""The DFKI pendulum: measured torques as commands, diagnosed, beside the authors' regression done again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.signal import medfilt

from forcegrasp.models.model_file import read_model
from tools.real_data.dfki_open_loop import fit
from tools.real_data.dfki_regression import PUBLISHED, regress
from tools.real_data.judge import add_base, best_model, windows
from tools.real_data.study import Error, Study, checksums
from tools.real_data.verbs import Verbs

MINUTES = 4
#: Their friction is Fc arctan(100 q'), which reaches Fc π/2; their offset is on the other side of the equation.
AS_EFFECTS = {
    "coulomb_friction.torque_nm": PUBLISHED["Fc"] * np.pi / 2,
    "motor_offset.offset_nm": -PUBLISHED["offset"],
    "damping": PUBLISHED["Fv"],
}
#: What their testbench_description.md says: 0.546 kg at 0.5 m, and a rod of 0.13 kg.
WEIGHED = {"J": 0.5**2 * (0.546 + 0.13 / 3), "mc": 0.5 * (0.546 + 0.13 / 2)}


def study(data: Path, out: Path) -> Study:
    """Imports and diagnoses the one recording."""
    verbs, folder = Verbs(out), data / "dfki_pendulum" / "system_identification"
    measured = verbs.run("import", "import", str(folder), "format=dfki", makes="set")
    found = verbs.diagnosis("diagnosis", measured)
    result = Study(
        "dfki_pendulum", "DFKI: a quasi-direct drive with a pendulum",
        "weight and rod as published; the rotor's inertia and viscous friction are fitted",
        "windows of 0.3 s, each held out once",
        checksums(data, sorted(folder.glob("data_*.csv"))), [" ".join(s["command"]) for s in verbs.done.values()],
        seconds=verbs.seconds(),
    )  # fmt: skip
    model = read_model(best_model(out / "diagnosis"))
    add_base(result, model, AS_EFFECTS)
    result.take_diagnosis(found, AS_EFFECTS)
    noise = 1e3 * float(windows(measured, out / "diagnosis" / "base_model.yaml").sigma[0])
    result.errors.append(Error("position", "mrad", found["error_before"] * noise, found["error_after"] * noise, noise))
    columns = np.loadtxt(folder / "data_measured.csv", skiprows=1, delimiter=",").T
    again = regress(*columns)
    rows = [["", "published", "again", "weight and rod as described"]]
    for name, published in PUBLISHED.items():
        described = f"{WEIGHED[name]:.4f}" if name in WEIGHED else "–"
        rows.append([name, f"{published:.4f}", f"{again[name]:.4f}", described])
    result.tables["The authors' regression of the measured torque, done again"] = rows
    time, position, _, torque = columns
    result.tables["What the measured torque says of friction when it moves the pendulum"] = _moved_by(
        time, position, torque
    )
    return result


def _moved_by(time: np.ndarray, position: np.ndarray, torque: np.ndarray) -> list[list[str]]:
    """Friction and offset with the torque as it is, with its spikes cut, and without any; ± two standard errors."""
    torques = {"as measured": torque, "median of five": medfilt(torque, 5), "none at all": 0 * torque}
    rows = [["weight and rod", "torque", "Fv", "Fc", "offset", "left [mrad]"]]
    for which, weight in {"as described": WEIGHED, "as published": PUBLISHED}.items():
        for name, acting in torques.items():
            found = fit(time, position, acting, weight["J"], weight["mc"])
            told = [f"{value:.3f} ± {2 * error:.3f}" for value, error in zip(found.values, found.errors, strict=True)]
            rows.append([which, name, *told, f"{1e3 * found.left_rad:.1f}"])
    return rows
