"""Hides effects in sets of an independent recorder, diagnoses them, and reports how often that succeeds.

    python tools/hidden_effects.py run [--only REGEX] [--jobs 2]   diagnoses what has no result yet; may be stopped,
                                                                   and goes on where docs/hidden-effects.jsonl ends
    python tools/hidden_effects.py run --renew                     also what other code than the present has measured
    python tools/hidden_effects.py report [--all]                  writes docs/hidden-effects*.md from the results of
                                                                   the code that measured last, or of all code
    python tools/hidden_effects.py check                           fails if a page is of other code than the present

The recorder is tests/independent: it shares no code with the effects under test. Sets come in random order, so that a
part of them is a fair sample of all. A set takes three minutes of one core.
"""

from __future__ import annotations

import argparse
import random
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from forcegrasp.diagnosis.found_law import FoundLaw

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
PAGES = tuple(ROOT / "docs" / f"{name}.md" for name in ("hidden-effects", "hidden-effects-of-servos"))
#: A line for each set, kept with the pages: what one machine began another goes on with.
RESULTS = ROOT / "docs" / "hidden-effects.jsonl"
SIZES = ("small", "medium", "large")
PAIRS = (
    ("command_delay", "force_bias"),
    ("coulomb_friction", "force_lag"),
    ("backlash", "force_gain_asymmetry"),
    ("object_friction", "force_drift"),
    ("rate_limit", "force_saturation"),
    ("finger_compliance", "encoder_bias"),
)
#: What grasps that close and hold hardly tell from another one of these: all of them are late.
LIKE_OTHERS = ("command_delay", "actuator_lag", "force_delay", "force_lag")
#: Hidden in logs of a slide without fingers, alone and in pairs.
OF_SERVOS = (
    "coulomb_friction", "stiction", "load_friction", "presliding", "direction_friction", "position_deadband",
    "back_emf", "motor_offset", "swinging_load", "readout_skew", "command_delay", "rate_limit", "actuator_lag",
    "smooth_friction", "stale_velocity",
)  # fmt: skip
PAIRS_OF_SERVOS = (
    ("coulomb_friction", "motor_offset"),
    ("load_friction", "readout_skew"),
    ("stiction", "command_delay"),
    ("position_deadband", "back_emf"),
    ("presliding", "motor_offset"),
    ("direction_friction", "rate_limit"),
    ("swinging_load", "coulomb_friction"),
)


#: What is wrong with a set, two at a time, and what tells it.
MISTAKES = {
    "clock_doubled": "time_scale", "commands_late": "early_row", "tare": "force_tare", "one_radius": "object_radius",
}  # fmt: skip
#: What every real rig has: objects 0.3 mm off, encoders, gains, a little friction, a clock, heavy-tailed noise.
MESS: dict[str, dict[str, float]] = {
    "encoder_bias": {"left": 1e-4, "right": -6e-5},
    "force_gain_asymmetry": {"right_excess": 0.03},
    "smooth_friction": {"level": 0.008},
}
MESSY_JITTER_S = 0.0015
#: Groups of sets in which a law is looked for where something is left: where there is one, and where there is none.
WITH_LAW = ("outside", "none", "noise")


@dataclass(frozen=True)
class Job:
    """One set to record and diagnose."""

    group: str  #: see :func:`jobs`
    hidden: tuple[str, ...]  #: names in the recorder
    size: str
    seed: int
    contact: str = "mujoco"
    grasps: int = 24
    noise: str = "white"
    spoiled: str = ""
    plan: str = "rich"

    @property
    def name(self) -> str:
        """What the result is filed under."""
        parts = ["+".join(self.hidden) or "none", self.size, f"s{self.seed}", self.contact, f"n{self.grasps}"]
        if self.is_servo:
            return "_".join(["servo", *filter(None, parts[:3])])
        parts += [self.noise if self.noise != "white" else "", self.spoiled, "messy" if self.group == "messy" else ""]
        parts += [self.plan if self.plan != "rich" else ""]
        return "_".join(filter(None, parts))

    @property
    def is_servo(self) -> bool:
        """Whether it is logs of a servo, and not grasps."""
        return self.group.startswith("servo")


def jobs() -> list[Job]:
    """The whole campaign, in random order."""
    from tests.independent.rig import CATALOGUE, OTHERWISE, OUTSIDE, VARIANTS
    from tests.independent.spoiled import SPOILED

    rng = random.Random(0)

    def several(count: int) -> tuple[str, ...]:
        while True:  # of what gives way between motor and pad the rig has one at a time
            names = tuple(sorted(rng.sample(sorted(CATALOGUE), count)))
            if not {"backlash", "finger_compliance"} <= set(names):
                return names

    found = [Job("none", (), "", seed) for seed in range(1, 21)]
    for noise in ("heavy", "slow", "outliers", "louder", "quieter"):
        found += [Job("noise", (), "", seed, noise=noise) for seed in range(21, 27)]
    for seed, size in enumerate(("medium", "small", "large"), 1):
        found += [Job("one", (name,), size, seed) for name in CATALOGUE]
        found += [Job("law", (name,), size, seed) for name in OTHERWISE]
        found += [Job("outside", (name,), size, seed) for name in OUTSIDE if size != "small"]
    found += [Job("other reading", (name,), "medium", 2) for name in VARIANTS]
    found += [Job("one", (name,), "medium", 4, grasps=10) for name in CATALOGUE]
    found += [Job("one", (name,), "small", 5, grasps=48) for name in rng.sample(sorted(CATALOGUE), 8)]
    found += [Job("one", (name,), "large", 6, grasps=6) for name in rng.sample(sorted(CATALOGUE), 16)]
    for contact in ("mujoco_multiccd", "mujoco_rubbing", "penalty", "hertz"):
        found += [Job("contact", (), "", seed, contact) for seed in range(1, 5)]
        found += [Job("contact", (name,), "medium", 7, contact) for name in rng.sample(sorted(CATALOGUE), 6)]
    found += [Job("several", pair, "medium", seed) for seed, pair in enumerate(PAIRS, 1)]
    found += [Job("several", several(count), "medium", 10 * count + k) for count in (2, 3, 4, 5) for k in range(15)]
    for spoiled in sorted(set(SPOILED) - {""}):
        found += [Job("spoiled", (), "", seed, spoiled=spoiled) for seed in range(30, 37)]

    for k, pair in enumerate(combinations(MISTAKES, 2)):
        found += [Job("two mistakes", (), "", seed, spoiled="+".join(pair)) for seed in range(30 + 3 * k, 33 + 3 * k)]

    def messy(hidden: tuple[str, ...], size: str, seed: int) -> Job:
        return Job("messy", hidden, size, seed, noise="heavy", spoiled="radius_0.3mm")

    found += [messy((), "", seed) for seed in range(40, 55)]
    found += [messy((name,), "medium", 60 + k) for k, name in enumerate(sorted(CATALOGUE))]
    found += [messy(several(count), "medium", 100 * count + k) for count in (2, 3) for k in range(15)]
    found += [
        Job("tie", (name,), "medium", 80 + k, grasps=9, plan="close_and_hold")
        for k, name in enumerate(sorted(CATALOGUE))
    ]
    found += [
        Job("tie", (name,), "medium", 120 + 10 * k + seed, grasps=9, plan="close_and_hold")
        for k, name in enumerate(LIKE_OTHERS)
        for seed in range(2)
    ]
    found += [
        Job("contact", (), "", seed, contact)
        for contact in ("mujoco_damped", "mujoco_ringing", "mujoco_light", "mujoco_firm")
        for seed in range(1, 5)
    ]
    found += _servo_jobs()
    rng.shuffle(found)
    return found


def _servo_jobs() -> Iterator[Job]:
    """Sets of a servo: effects alone in three sizes, pairs of them three times, and 30 with nothing hidden."""
    for seed, size in enumerate(("medium", "large", "small"), 1):
        yield from (Job("servo none", (), "", 10 * seed + k, "", 0) for k in range(10))
        yield from (Job("servo one", (name,), size, seed, "", 0) for name in OF_SERVOS)
        yield from (Job("servo two", pair, "medium", seed, "", 0) for pair in PAIRS_OF_SERVOS)


def right_names(job: Job) -> set[str]:
    """What a right diagnosis names."""
    from tests.independent.catalogue import OTHERWISE, VARIANT_OF
    from tests.independent.slide import CALLED

    if job.group == "outside":
        return set()
    if job.group == "two mistakes":
        return {MISTAKES[spoiled] for spoiled in job.spoiled.split("+")}
    called = VARIANT_OF | CALLED | {name: answer for name, (answer, _) in OTHERWISE.items()}
    of_contact = {
        "mujoco_rubbing": "contact_friction", "mujoco_damped": "contact_damping", "mujoco_ringing": "contact_damping",
        "mujoco_light": "object_mass", "mujoco_firm": "contact_onset", "penalty": "hunt_crossley_contact",
        "hertz": "hunt_crossley_contact",
    }  # fmt: skip
    also = {of_contact[job.contact]} if job.contact in of_contact else set()
    return {called.get(name, name) for name in job.hidden} | also


def run_job(job: Job) -> dict:
    """Records and diagnoses one set."""
    from forcegrasp.cli.measuring import refuse_table
    from forcegrasp.diagnosis.diagnose_set import diagnose_set
    from forcegrasp.errors import MeasurementError
    from forcegrasp.identify.fitted_model import model_of
    from forcegrasp.identify.loading import load
    from forcegrasp.identify.verdict import Verdict
    from forcegrasp.replay import replay
    from tests.independent import rig, slide
    from tools.hidden_effects_ties import settle

    replay.THREADS = 1
    folder = Path(tempfile.mkdtemp())
    try:
        chosen: dict[str, str | dict] = dict.fromkeys(job.hidden, job.size)
        of_jitter = 0.0
        if job.is_servo:
            truth = slide.record(folder / "set", chosen, job.seed)
        else:
            messy = job.group == "messy"
            hidden = {**MESS, **chosen} if messy else chosen
            of_jitter = rig.left_by_jitter(hidden, job.seed, MESSY_JITTER_S) if messy else 0.0
            truth = rig.record(
                folder / "set",
                hidden,
                job.seed,
                job.grasps,
                job.plan,
                job.contact,
                noise=job.noise,
                jitter_s=MESSY_JITTER_S if messy else 0.0,
                spoiled=job.spoiled,
            )
        started, busy = time.perf_counter(), time.process_time()
        try:
            loaded = refuse_table(load(folder / "set"), "fit")
        except MeasurementError as refusal:  # what is wrong with the set was told before anything was fitted
            return {"name": job.name, **asdict(job), "verdict": "refused", "left": str(refusal)}
        diagnosis, _ = diagnose_set(loaded, None, [], 0, lambda text: None, law=job.group in WITH_LAW)
        seconds, processor = time.perf_counter() - started, time.process_time() - busy
        model = model_of(diagnosis.fit, diagnosis.target, loaded, diagnosis.numerical)
        tied = diagnosis.verdict is Verdict.ONE_OF and job.group == "tie"
        further = settle(folder, truth, diagnosis) if tied and isinstance(truth, rig.Truth) else {}
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return {
        "name": job.name,
        **asdict(job),
        "verdict": diagnosis.verdict,
        "effects": list(diagnosis.effects),
        "steps": [[s.verdict, list(s.effects)] for s in diagnosis.steps],
        "shares": diagnosis.shares(),
        "found_parameters": {e.effect.name: {n: p.value for n, p in e.parameters.items()} for e in model.effects},
        "error_before": diagnosis.error_before,
        "error_after": diagnosis.error_after,
        "floor": diagnosis.floor,
        "of_jitter": of_jitter,
        "left": diagnosis.left,
        "reason": diagnosis.base.reason,
        "seconds": seconds,
        "processor_s": processor,
        "intervals": [] if job.is_servo else _intervals(model, truth),
        "moved": "" if diagnosis.fault is None else diagnosis.fault.words,
        "faults": [] if diagnosis.fault is None or diagnosis.fault.moved else list(diagnosis.fault.names),
        "law": None if diagnosis.law is None else _law(diagnosis.law),
        "further": further,
    }


def _law(law: FoundLaw) -> dict:
    return {"place": law.law.formula_of.place, "expression": law.law.formula_of.expression, "share": law.share}


def _intervals(model, truth) -> list[list]:
    """Parameter, truth and interval of every base parameter."""
    rows = [
        ["position_gain", truth.position_gain, model.base["position_gain"]],
        ["velocity_gain", truth.b2, model.base["velocity_gain"]],
    ]
    for name, true in truth.objects.items():
        if name in model.objects:
            rows.append([f"rho_m of {name}", true["rho_m"], model.objects[name]["rho_m"]])
            rows.append([f"force_scale of {name}", true["f_alpha"], model.objects[name]["force_scale"]])
    return [[name, true, fitted.low, fitted.high] for name, true, fitted in rows]


def run(only: str, workers: int, renew: bool) -> None:
    """Works through what has no result yet, or none of the present code."""
    from tools.json_lines import append
    from tools.measured_code import stamp

    code = stamp()  # of what the workers are about to import
    done = {row["name"] for row in load_results() if not renew or row.get("digest") == code["digest"]}
    todo = [job for job in jobs() if job.name not in done and re.search(only, job.name)]
    print(f"{len(todo)} sets to diagnose, {len(done)} done")
    with ProcessPoolExecutor(workers) as pool:
        running = {pool.submit(run_job, job): job for job in todo}
        for number, future in enumerate(as_completed(running), 1):
            try:
                row = future.result()
            except Exception as error:  # one set that fails must not take the others along; the report counts it
                row = {
                    "name": running[future].name,
                    **asdict(running[future]),
                    "verdict": "error",
                    "error": repr(error),
                }
            row |= code
            append(RESULTS, row)
            said = ", ".join(row.get("effects", [])) or row.get("error", "")
            print(
                f"[{number}/{len(todo)}] {row['name']}: {row['verdict']} {said} ({row.get('processor_s', 0):.0f} s)",
                flush=True,
            )


def load_results() -> list[dict]:
    """All results so far, the last of each name, in the order in which these were measured."""
    from tools.json_lines import read

    results: dict[str, dict] = {}
    for row in read(RESULTS):
        results.pop(row["name"], None)
        results[row["name"]] = row
    return list(results.values())


def check() -> int:
    """Exit status: 1 if a page says that it measured other code than the present."""
    from tools.measured_code import PACKAGES, digest, outdated

    now = digest()
    found = [(page, line) for page in PAGES for line in outdated(page.read_text(), now)]
    for page, line in found:
        print(f"{page.relative_to(ROOT)}: {line}")
    if found:
        print(f"Now it is digest {now}: forcegrasp/{', '.join(PACKAGES)} changed since. Measure anew, for hours:")
        print("python tools/hidden_effects.py run --renew, then report; until then: --skip hidden-effects")
    return int(bool(found))


def main() -> int:
    """Reads the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("run", "report", "check"))
    parser.add_argument("--only", default="", help="regular expression that a set's name must match")
    parser.add_argument("--jobs", type=int, default=2, help="diagnoses side by side")
    parser.add_argument("--renew", action="store_true", help="measure again what is not of the present code")
    parser.add_argument("--all", action="store_true", help="report the results of all code, not of the last alone")
    arguments = parser.parse_args()
    if arguments.what == "check":
        return check()
    if arguments.what == "run":
        run(arguments.only, arguments.jobs, arguments.renew)
    else:
        from tools.hidden_effects_report import write

        write(load_results(), jobs(), right_names, of_all=arguments.all)
    return 0


if __name__ == "__main__":
    sys.exit(main())
