"""The jaw of an SO-101: all ten motions, then splits by whole motions, each fitted on seven and judged on three."""

from __future__ import annotations

import csv
import itertools
import shutil
from pathlib import Path

import numpy as np
import polars as pl

from forcegrasp.models.model_file import read_model
from tools.real_data.judge import add_base, best_model, windows
from tools.real_data.study import Error, Study, checksums, found_steps
from tools.real_data.verbs import Verbs

MINUTES = 90
#: Splits, and how many motions each of them judges.
SPLITS, JUDGED = 20, 3


def study(data: Path, out: Path, splits: int = SPLITS) -> Study:
    """Imports, diagnoses all motions, and then each split."""
    verbs, folder = Verbs(out), data / "so101_jaw"
    measured = verbs.run("import", "import", str(folder), "format=sage", "joints=[Jaw]", makes="set")
    motions = pl.read_csv(measured / "recordings.csv")["recording"].to_list()
    found = verbs.diagnosis("diagnosis", measured)
    result = Study(
        "so101_jaw", "The jaw of an SO-101: a Feetech STS3215, empty",
        "position gain, damping and read-out skew are fitted; the inertia is as published",
        "ten motions, each held out as a whole",
        checksums(data, [f for f in folder.glob("*/*") if f.suffix in (".csv", ".txt")]),
        [" ".join(s["command"]) for s in verbs.done.values()],
    )  # fmt: skip
    best, base = best_model(out / "diagnosis"), out / "diagnosis" / "base_model.yaml"
    add_base(result, read_model(best), {})
    result.take_diagnosis(found)
    before, after = (windows(measured, file) for file in (base, best))
    noise = 1e3 * float(before.sigma[0])
    for motion in motions:
        left, then = (1e3 * part.rms(sessions=(motion,)) for part in (before, after))
        result.errors.append(Error(motion, "mrad", left, then, noise))
    if splits:
        result.tables["Splits by whole motions"] = _splits(verbs, measured, motions, out, splits)
    result.seconds = verbs.seconds("import", "diagnosis")  # of all motions together
    return result


def _splits(verbs: Verbs, measured: Path, motions: list[str], out: Path, splits: int) -> list[list[str]]:
    """What each split finds: a table with a row each."""
    rows = [["judged on", "verdict", "found", "or else", "error held out, × noise"]]
    every = list(itertools.combinations(sorted(motions), JUDGED))
    for number, index in enumerate(np.random.default_rng(0).permutation(len(every))[:splits]):
        judged = list(every[index])
        split = _split(measured, out / f"split_{number:02d}", judged)
        found = verbs.diagnosis(f"diagnosis_{number:02d}", split)
        steps = found_steps(found)
        rows.append([
            ", ".join(judged), found["verdict"], ", ".join(step[0] for step in steps) or "–",
            ", ".join(dict.fromkeys(name for step in steps for name in step[1:])) or "–",
            f"{found['error_before']:.1f} → {found['error_after']:.1f}",
        ])  # fmt: skip
    return rows


def _split(measured: Path, folder: Path, judged: list[str]) -> Path:
    """The same set with other marks of what is fitted and what judged."""
    if not (folder / "meta.yaml").is_file():
        folder.mkdir(parents=True, exist_ok=True)
        for name in ("samples.parquet", "meta.yaml"):
            shutil.copy(measured / name, folder / name)
        motions = pl.read_csv(measured / "recordings.csv")["recording"].to_list()
        with open(folder / "recordings.csv", "w", newline="") as file:
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(["recording", "split"])
            rows.writerows([name, "check" if name in judged else "fit"] for name in motions)
    return folder
