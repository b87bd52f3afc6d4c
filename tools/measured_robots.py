"""Measures robots of docs/robots.md one by one, diagnoses and retrains for each, and fills in a table of the page.

    python tools/measured_robots.py                 eight robots of the test half: some three hours on one core
    python tools/measured_robots.py --robots 0 2    others
    python tools/measured_robots.py --report        writes what there is so far into the page; seconds

Each robot has a folder in --out with what every command wrote, and a list of those that are done: what was stopped goes
on where it was, a training too. Two runs with other robots may work side by side.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
PAGE, PICTURE = ROOT / "docs" / "robots.md", Path("figures", "measured_robots.png")
WRITER = "tools/measured_robots.py"
#: Of the half on which nothing was chosen.
ROBOTS = (1, 3, 5, 7, 9, 11, 13, 15)
#: Control steps of a retraining.
FRAMES = 3_000_000
#: Who is compared on the robot: policies of the package, the one retrained with what was found, and one retrained with
#: all that is hidden, which no measurement tells: what a perfect diagnosis would bring.
OTHERS, RETRAINED, PERFECT = ("ib", "catalogue", "force_pi"), "retrained", "perfect"
_GRASPS = ("kappas=5", "trials=20", "physics=fast")
_REWARD = "force_reward_measured"
_WHERE = ("simulator", "robot")
_WHO = (*OTHERS, RETRAINED, PERFECT)

Row = dict[str, Any]


def commands(robot: int, folder: Path, frames: int) -> Iterator[tuple[str, list[str]]]:
    """Names of the steps for a robot, in turn, and what is run for each."""
    from tools.real_data.judge import best_model

    model, measured, why = (folder / name for name in ("robot.yaml", "set", "why"))
    yield "robot", ["robot", str(robot), f"out={model}"]
    yield "measured", ["record", f"model={model}", "objects=6", f"out={measured}"]
    yield "diagnosed", ["diagnose", f"data={measured}", f"out={why}"]
    runs = {folder / RETRAINED: best_model(why), folder / PERFECT: model}
    for run, learnt_from in runs.items():
        given = ["experiment=retrain", f"model={learnt_from}", "seed=1", f"ppo.total_frames={frames}"]
        given += ["log.video_every=0", "log.figures_every=0"]
        begun = (run / "config.yaml").exists()
        yield run.name, ["train", *([f"resume={run}"] if begun else [*given, f"hydra.run.dir={run}"])]
    for where, who, more in zip(_WHERE, (["ib"], [*runs, *OTHERS]), ([], [f"model={model}"]), strict=True):
        policies = f"policies=[{','.join(map(str, who))}]"
        yield f"evaluated on {where}", ["evaluate", policies, *more, *_GRASPS, f"out={folder / where}"]


def work_through(robots: Sequence[int], out: Path, frames: int) -> None:
    """Runs what has not been run.

    Raises:
      SystemExit: with the exit status of a command that failed, after a line that names it.
    """
    from tools.results.execute import run_command
    from tools.results.stage import ready_to_run

    for robot in robots:
        folder = (out / f"robot_{robot}").resolve()
        folder.mkdir(parents=True, exist_ok=True)
        notes = folder / "done.txt"
        done = notes.read_text("utf-8").splitlines() if notes.exists() else []
        for step, words in commands(robot, folder, frames):
            if step in done:
                continue
            print(f"robot {robot}: forcegrasp {' '.join(words)}", flush=True)
            if status := run_command(ready_to_run(("forcegrasp", *words))):
                raise SystemExit(f"robot {robot}: forcegrasp {words[0]} failed (exit status {status})")
            with notes.open("a", encoding="utf-8") as file:
                file.write(f"{step}\n")


def judged(folder: Path) -> Row:
    """What came out for one robot."""
    from forcegrasp.models.model_file import read_model
    from forcegrasp.models.object_body import ObjectBody
    from tools.real_data.judge import best_model

    robot, found = read_model(folder / "robot.yaml"), read_model(best_model(folder / "why"))
    diagnosis = json.loads((folder / "why" / "diagnosis.json").read_text("utf-8"))
    home, away = (json.loads((folder / where / "evaluation.json").read_text("utf-8")) for where in _WHERE)
    home, away = home["policies"], away["policies"]
    hidden = {"contact_friction" if e.effect is ObjectBody else e.effect.name for e in robot.effects}
    named = {e.effect.name for e in found.effects}
    return {
        "robot": int(folder.name.partition("_")[2]),
        "hidden": len(hidden),
        "found": len(hidden & named),
        "others": sorted(named - hidden),
        "before": diagnosis["error_before"] / diagnosis["floor"],
        "after": diagnosis["error_after"] / diagnosis["floor"],
        "simulator": home["ib"][_REWARD]["mean"],
        **{name: away[name][_REWARD]["mean"] for name in _WHO},
    }


def table(rows: Sequence[Row]) -> str:
    """A row for each robot, and their mean."""
    from tools.results import tables

    def rewards(of: Row) -> list[str]:
        """And the share of what ``ib`` loses that retraining gains back."""
        gained = (of[RETRAINED] - of["ib"]) / (of["simulator"] - of["ib"])
        return [*(f"{of[name]:.1f}" for name in ("simulator", *_WHO)), f"{100 * gained:.0f} %"]

    heads = ["robot", "effects found", "besides", "error ÷ floor", "`ib` in the simulator", *(f"`{n}`" for n in OTHERS)]
    heads += ["retrained with what was found", "with all that is hidden", "gained back"]
    lines = []
    for row in rows:
        besides = ", ".join(f"`{name}`" for name in row["others"])
        errors = f"{row['before']:.1f} → {row['after']:.2f}"
        found = f"{row['found']} of {row['hidden']}"
        lines.append([str(row["robot"]), found, besides, errors, *rewards(row)])
    means = {name: sum(row[name] for row in rows) / len(rows) for name in ("simulator", *_WHO)}
    return tables.table(heads, [*lines, ["mean", "", "", "", *rewards(means)]])


def report(out: Path, page: Path = PAGE) -> None:
    """Writes the robots that are done into the page."""
    folders = sorted(out.glob("robot_*"), key=lambda folder: int(folder.name.partition("_")[2]))
    rows = [judged(folder) for folder in folders if (folder / "robot" / "evaluation.json").exists()]
    if not rows:
        raise SystemExit(f"{out}: no robot is done; run this program without --report first")
    from tools.marked_part import with_part

    page.write_text(with_part(page.read_text("utf-8"), WRITER, table(rows)), "utf-8")
    draw(rows, page.parent / PICTURE)
    print(f"wrote {page}: {len(rows)} robots")


def draw(rows: Sequence[Row], picture: Path) -> None:
    """Draws each robot's rewards above one another."""
    import matplotlib.pyplot as plt
    import numpy as np

    from forcegrasp.evaluate.colours import policy_colours

    figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
    colours = policy_colours(_WHO)
    called = {RETRAINED: "retrained with what was found", PERFECT: "retrained with all that is hidden"}
    places = np.arange(len(rows))
    in_simulator = [row["simulator"] for row in rows]
    axes.plot(places, in_simulator, "_k", ms=60, label="ib in the training simulator")
    for beside, name in zip(np.linspace(-0.2, 0.2, len(_WHO)), _WHO, strict=True):
        marker = {RETRAINED: "o", PERFECT: "_"}.get(name, ".")
        rewards = [row[name] for row in rows]
        axes.plot(places + beside, rewards, marker, ms=9, mew=2, color=colours[name], label=called.get(name, name))
    axes.set_xlim(-0.5, len(rows) - 0.5)
    axes.set_xticks(places, [str(row["robot"]) for row in rows])
    axes.set(xlabel="robot", ylabel="force reward of 150, measured forces")
    axes.grid(axis="y", alpha=0.3)
    figure.legend(loc="outside upper center", ncols=3, frameon=False, markerscale=0.6)
    picture.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(picture, dpi=110)
    plt.close(figure)


def main(arguments: Sequence[str] | None = None) -> None:
    """Reads the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", nargs="+", type=int, default=ROBOTS, metavar="NUMBER")
    parser.add_argument("--out", type=Path, default=ROOT / "runs" / "measured_robots", help="where results are kept")
    parser.add_argument("--frames", type=int, default=FRAMES, help="control steps of a retraining")
    parser.add_argument("--report", action="store_true", help="write the page, and run nothing")
    given = parser.parse_args(arguments)
    if not given.report:
        work_through(given.robots, given.out, given.frames)
    report(given.out)


if __name__ == "__main__":
    main()
