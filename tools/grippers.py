"""Trains on each gripper that comes with the package, hides effects in sets of it, and fills in docs/grippers.md.

    python tools/grippers.py --stage train      trains and evaluates beside force_pi: minutes per gripper
    python tools/grippers.py --stage diagnose   hides effects in sets and diagnoses them: a minute or more per set
    python tools/grippers.py --stage report     writes what there is so far into docs/grippers.md; seconds
    python tools/grippers.py --stage picture    draws docs/figures/grippers.png; needs OpenGL, half a minute

Results are kept in --out as soon as there are any: a stage that was stopped goes on where it was, a training too.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
#: Of `experiment=recommended budget=quick`, and what they take on two idle cores with TIAGo's gripper.
FRAMES, MINUTES = 2_500_000, 3.5
#: Largest error ÷ floor with which an effect counts as removed.
REMOVED = 1.1
NOTHING = "nothing"


class Results:
    """What was found so far, a line of JSON each; the last one of a key counts."""

    def __init__(self, folder: Path) -> None:
        from tools.json_lines import read

        self.file = folder / "results.jsonl"
        self.rows = {row["key"]: row for row in read(self.file)}

    def add(self, key: str, row: dict[str, Any]) -> None:
        """Keeps a row, on the disk at once."""
        from tools.json_lines import append

        self.rows[key] = {"key": key} | row
        append(self.file, self.rows[key])

    def of(self, stage: str, gripper: str) -> list[dict[str, Any]]:
        """Rows of a stage and a gripper."""
        return [r for r in self.rows.values() if r["stage"] == stage and r["gripper"] == gripper]


# --- training ------------------------------------------------------------------------------------------------------


def train(grippers: list[str], frames: int, trials: int, folder: Path) -> None:
    """Trains on each gripper and evaluates the policy beside force_pi on the same grasps."""
    results = Results(folder)
    todo = [name for name in grippers if f"train {name} {frames}" not in results.rows]
    minutes = len(todo) * MINUTES * frames / FRAMES
    print(
        f"to train: {', '.join(todo) or 'nothing'}; {frames:,} control steps each, then {trials} grasps per softness."
        f" About {minutes:.0f} minutes on two idle cores if all are as fast as tiago",
        flush=True,
    )
    for name in todo:
        run = folder / f"train_{name}_{frames}"
        _train(name, frames, run)
        seconds = _seconds(run)
        row = {"stage": "train", "gripper": name, "frames": frames, "trials": trials, "seconds": seconds}
        row["policies"] = evaluate(name, {"policy": str(run), "force_pi": "force_pi"}, trials)
        results.add(f"train {name} {frames}", row)
        rewards = ", ".join(f"{k} {v['force_reward']:.1f}" for k, v in row["policies"].items())
        print(f"{name}: {rewards} of 150; trained in {seconds:.0f} s", flush=True)


def _train(gripper: str, frames: int, run: Path) -> None:
    """Trains, or goes on with it."""
    from forcegrasp.cli.main import main as forcegrasp

    given = ["experiment=recommended", "budget=quick", f"gripper={gripper}", f"ppo.total_frames={frames}"]
    fresh = [*given, f"hydra.run.dir='{run}'"]
    if status := forcegrasp(["train", *([f"resume={run}"] if (run / "config.yaml").exists() else fresh)]):
        raise SystemExit(status)


def _seconds(run: Path) -> float:
    """Seconds that a training took without its start, pauses left out: those of its batches."""
    with (run / "metrics.csv").open(encoding="utf-8") as file:
        rows = [(float(row["frames"]), float(row["speed/frames_per_s"])) for row in csv.DictReader(file)]
    before = [0.0, *(frames for frames, _ in rows)]
    return sum((frames - last) / rate for last, (frames, rate) in zip(before, rows, strict=False))


def evaluate(gripper: str, policies: dict[str, str], trials: int) -> dict[str, dict[str, float]]:
    """Mean figures of policies, by name, over the same grasps of 11 softness values."""
    from forcegrasp.config import EvaluateConfig
    from forcegrasp.env.episodes import summarise
    from forcegrasp.evaluate.grids import kappa_grid
    from forcegrasp.evaluate.policies import load_policies
    from forcegrasp.evaluate.rollouts import roll_out
    from forcegrasp.physics.completion import complete

    loaded = load_policies(list(policies.values()), gripper)
    hand = loaded[0].gripper
    config = complete(EvaluateConfig(), hand)
    grid, found = kappa_grid(config.grasp, config.kappas, trials, config.seed, hand), {}
    for name, evaluated in zip(policies, loaded, strict=True):
        parts = {"action": evaluated.action, "observation": evaluated.observation}
        sensors = config.sensors
        episodes = roll_out(
            evaluated.policy, grid.grasps, config.grasp, config.seed, gripper=hand, sensors=sensors, **parts
        )
        figures = {key: float(value.mean()) for key, value in summarise(episodes, sensors, hand.period_s).items()}
        found[name] = {
            "force_reward": figures["force_reward_normalised"],
            "peak_force_n": figures["peak_force_n"],
            "overshoot_percent": figures["overshoot_percent"],
            "moved_mm": figures["displacement_until_grasped_mm"],
        }
    return found


# --- hidden effects ------------------------------------------------------------------------------------------------


def hidden_in(gripper: str) -> list[str]:
    """What is hidden in sets of a gripper: an effect of each kind, dry friction where effort is all that is read."""
    from forcegrasp.physics import load_gripper

    return ["backlash", "command_delay", *(["coulomb_friction"] if load_gripper(gripper).force == "motor" else [])]


def jobs(grippers: list[str], sets: int, plain: int, first: int = 1) -> Iterator[tuple[str, str, int]]:
    """Gripper, what is hidden, and seed of each set: some of all first, so that a stopped campaign says of each."""
    for seed in range(first, first + max(sets, plain)):
        for gripper in grippers:
            if seed < first + plain:
                yield gripper, NOTHING, seed
            if seed < first + sets:
                yield from ((gripper, effect, seed) for effect in hidden_in(gripper))


def diagnose(grippers: list[str], sets: int, plain: int, first: int, grasps: int, folder: Path) -> None:
    """Records sets with an effect hidden in them, and without, and diagnoses them."""
    results = Results(folder)
    all_jobs = [
        (f"diagnose {g} {hidden} {seed} {grasps}", g, hidden, seed)
        for g, hidden, seed in jobs(grippers, sets, plain, first)
    ]
    todo = [job for job in all_jobs if job[0] not in results.rows]
    print(f"{len(todo)} sets of {grasps} grasps to diagnose, {len(all_jobs) - len(todo)} done; a minute or more each")
    for key, gripper, hidden, seed in todo:
        row = diagnose_one(gripper, hidden, seed, grasps)
        results.add(
            key, {"stage": "diagnose", "gripper": gripper, "hidden": hidden, "seed": seed, "grasps": grasps} | row
        )
        named = ", ".join(row["named"]) or "nothing named"
        print(f"{gripper}, {hidden} {seed}: {named}; {row['ratio']:.2f} × floor; {row['seconds']:.0f} s", flush=True)


def diagnose_one(gripper: str, hidden: str, seed: int, grasps: int) -> dict[str, Any]:
    """Records one set, with an effect of typical size, and diagnoses it; the diagnosis is not given it."""
    from forcegrasp.config import RecordConfig
    from forcegrasp.diagnosis.diagnose_set import diagnose_set
    from forcegrasp.identify.loading import Loaded
    from forcegrasp.physics import load_gripper
    from forcegrasp.physics.completion import complete
    from forcegrasp.replay.record import parse_effect, record

    hand = load_gripper(gripper)
    config = complete(RecordConfig(), hand)
    effects = [] if hidden == NOTHING else [parse_effect(hidden, hand)]
    recorded = record(
        hand, config.plan, grasps=grasps, objects=config.objects, effects=effects, known={}, seed=seed,
        off_nominal=config.off_nominal, position_std_m=config.position_std_m, force_std_n=config.force_std_n,
    )  # fmt: skip
    started = time.perf_counter()
    diagnosis, _ = diagnose_set(Loaded(recorded.measured, hand, []), None, [], seed, lambda text: None)
    return {
        "verdict": diagnosis.verdict,
        "named": list(diagnosis.preferred),
        "ratio": diagnosis.error_after / diagnosis.floor,
        "seconds": time.perf_counter() - started,
    }


def is_right(row: dict[str, Any]) -> bool:
    """Whether a diagnosis named what was hidden and nothing else, and that removes the error."""
    named = [] if row["hidden"] == NOTHING else [row["hidden"]]
    return row["named"] == named and row["verdict"] != "one_of" and (not named or row["ratio"] <= REMOVED)


# --- the command line ----------------------------------------------------------------------------------------------


def main(arguments: list[str] | None = None) -> None:
    """Reads the command line."""
    from forcegrasp.physics.gripper_file import shipped_grippers

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stage", required=True, choices=("train", "diagnose", "report", "picture"))
    parser.add_argument("--grippers", nargs="+", choices=shipped_grippers(), default=shipped_grippers())
    parser.add_argument("--out", type=Path, default=ROOT / "runs" / "grippers", help="where results are kept")
    parser.add_argument("--frames", type=int, default=FRAMES, help="control steps of a training")
    parser.add_argument("--trials", type=int, default=40, help="grasps per softness value of an evaluation")
    parser.add_argument("--sets", type=int, default=10, help="sets per hidden effect")
    parser.add_argument("--plain", type=int, default=5, help="sets with nothing hidden")
    parser.add_argument("--first-seed", type=int, default=1, help="seed of the first set; others are another campaign")
    parser.add_argument("--grasps", type=int, default=20, help="grasps of a set")
    given = parser.parse_args(arguments)
    if given.stage == "train":
        train(given.grippers, given.frames, given.trials, given.out)
    elif given.stage == "diagnose":
        diagnose(given.grippers, given.sets, given.plain, given.first_seed, given.grasps, given.out)
    else:
        from tools import grippers_page

        if given.stage == "report":
            grippers_page.write(Results(given.out), given.grippers, is_right)
        else:
            grippers_page.draw(given.grippers)


if __name__ == "__main__":
    main()
