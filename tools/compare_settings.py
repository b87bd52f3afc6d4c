"""Trains with several settings, five seeds of each, and fills in the table of a page.

    python tools/compare_settings.py fewer_frames    what makes a good policy come sooner (docs/speed.md); 20 minutes
    python tools/compare_settings.py algorithms      every algorithm on the same budget (docs/algorithms.md); 40 minutes
    python tools/compare_settings.py NAME --report   only writes what there is so far into the page; seconds

Times are those of two cores: trainings run two side by side, a thread each. What was stopped goes on where it was.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from forcegrasp.runs.history import History

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))


@dataclass(frozen=True)
class Comparison:
    """Settings that a page has a table of.

    Args:
      page: its name in ``docs``.
      settings: folder of a setting's runs → options of ``forcegrasp train``.
      picture: whether the page has their learning curves, too.
    """

    page: str
    settings: dict[str, str]
    picture: bool = False

    @property
    def shared(self) -> list[str]:
        """Options that all settings have, which the table's head names."""
        first, *others = (options.split() for options in self.settings.values())
        return [word for word in first if all(word in other for other in others)]


_QUICK, _SAC = "experiment=quick", "experiment=sac sac.total_frames=96000"
_RECURRENT = "experiment=recurrent ppo.learning_rate=0.001"
COMPARISONS = {
    "fewer_frames": Comparison(
        "speed.md",
        {
            "quick": _QUICK,
            "eight_passes": f"{_QUICK} ppo.epochs=8",
            "64_grasps": f"{_QUICK} ppo.grasps=64",
        },
    ),
    # in the time that SAC takes for so many frames, and for as many frames
    "algorithms": Comparison(
        "algorithms.md",
        {
            "teacher": f"{_QUICK} ppo.total_frames=576000",
            "ppo": f"{_QUICK} ppo.teacher_weight=0 ppo.total_frames=576000",
            "recurrent": f"{_RECURRENT} ppo.total_frames=422400",
            "sac": _SAC,
            "teacher_few": f"{_QUICK} ppo.total_frames=96000",
            "ppo_few": f"{_QUICK} ppo.teacher_weight=0 ppo.total_frames=96000",
            "recurrent_few": f"{_RECURRENT} ppo.total_frames=96000",
        },
        picture=True,
    ),
}
#: A training has learned to grasp at this force reward of its episodes, in the normalised form.
GOAL = 100.0
_REWARD, _SPEED = "episode/force_reward_normalised", "speed/frames_per_s"
_FIGURES = ("force_reward_normalised", "overshoot_percent", "displacement_total_mm", "final_force_error_n")
_SIDE_BY_SIDE = ("hydra/launcher=joblib", "hydra.launcher.n_jobs=2", "physics.threads=1")
_NO_PICTURES = ("log.video_every=0", "log.figures_every=0")
_GRASPS = ("trials=30", "physics=fast")


def writer(name: str) -> str:
    """Who wrote the table, in the page's marks."""
    return f"tools/compare_settings.py {name}"


def commands(options: str, runs: Path, evaluation: Path, seeds: int) -> list[list[str]]:
    """What is run for a setting: its trainings, or what is left of them, and their evaluation."""
    given = [*options.split(), f"seed=range(1,{seeds + 1})", *_SIDE_BY_SIDE, *_NO_PICTURES, f"hydra.sweep.dir={runs}"]
    train = ["train", "-m", *([f"resume={runs}"] if (runs / "multirun.yaml").exists() else given)]
    return [train, ["evaluate", f"policies=[{runs}/*,force_pi]", *_GRASPS, f"out={evaluation}"]]


def _evaluation(out: Path, setting: str) -> Path:
    return out / "evaluations" / setting


def _done(out: Path, comparison: Comparison) -> list[str]:
    """Names of the settings that were trained and evaluated."""
    return [name for name in comparison.settings if (_evaluation(out, name) / "evaluation.json").exists()]


def work_through(comparison: Comparison, out: Path, seeds: int) -> None:
    """Runs what has not been run.

    Raises:
      SystemExit: if a command failed, after a line that names it.
    """
    from tools.results.execute import run_command
    from tools.results.stage import ready_to_run

    for name, options in comparison.settings.items():
        if name in _done(out, comparison):
            continue
        for words in commands(options, out / name, _evaluation(out, name), seeds):
            print(f"{name}: forcegrasp {' '.join(words)}", flush=True)
            if status := run_command(ready_to_run(("forcegrasp", *words))):
                raise SystemExit(f"{name}: forcegrasp {words[0]} failed (exit status {status})")


def _runs(folder: Path) -> list[History]:
    from forcegrasp.runs.history import find_histories

    return find_histories([folder], [_REWARD, _SPEED])[0]


def _seconds(run: History) -> np.ndarray:
    """When each of a run's batches was learned from, seconds of training, ``(n,)``."""
    return np.cumsum(np.diff(run.frames, prepend=0) / run.values[_SPEED])


def until_goal(runs: list[History]) -> str:
    """Frames until the reward of a batch reached the goal, mean over the runs in which it did."""
    reached = [run.frames[run.values[_REWARD] >= GOAL] for run in runs]
    first = [frames[0] for frames in reached if len(frames)]
    if not first:
        return "not reached"
    return f"{np.mean(first):,.0f}" + ("" if len(first) == len(runs) else f" in {len(first)} of {len(runs)}")


def table(comparison: Comparison, out: Path) -> str:
    """A row for each setting that is done."""
    from tools.results import tables
    from tools.results.seeds import read_evaluation, seeds_of

    rows = []
    for name in _done(out, comparison):
        runs, seeds = _runs(out / name), seeds_of(read_evaluation(_evaluation(out, name)))
        own = " ".join(word for word in comparison.settings[name].split() if word not in comparison.shared)
        took = f"{np.mean([_seconds(run)[-1] for run in runs]):.0f}"
        frames = f"{max(run.frames[-1] for run in runs):,.0f}"
        figures = tables.figures(list(seeds.values()), _FIGURES)
        rows.append([f"`{own}`" if own else "as it is", frames, took, until_goal(runs), *figures])
    if not rows:
        raise SystemExit(f"{out}: nothing is done; run this program without --report first")
    head = f"`{' '.join(comparison.shared)}` with" if comparison.shared else "training"
    header = [head, "frames", "s", f"frames until a training reward of {GOAL:.0f}", *tables.headings(_FIGURES)]
    return tables.table(header, rows)


def draw(comparison: Comparison, out: Path, picture: Path) -> None:
    """Draws learning curves over frames and over time: mean over seeds, and the range of them."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True, layout="constrained")
    for name in _done(out, comparison):
        runs = _runs(out / name)
        rewards = np.array([run.values[_REWARD] for run in runs])
        times = runs[0].frames / 1000, np.mean([_seconds(run) for run in runs], axis=0)
        for panel, time in zip(panels, times, strict=True):
            (line,) = panel.plot(time, rewards.mean(axis=0), label=name.replace("_", ", "))
            panel.fill_between(time, rewards.min(axis=0), rewards.max(axis=0), color=line.get_color(), alpha=0.2, lw=0)
    panels[0].set(xlabel="frames [thousands]", ylabel="force reward of training episodes", xscale="log")
    panels[1].set(xlabel="time [s]")
    for panel in panels:
        panel.axhline(GOAL, color="0.6", lw=0.8, ls=":")
        panel.spines[["top", "right"]].set_visible(False)
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=7, frameon=False, fontsize=8
    )
    figure.savefig(picture, dpi=110)
    plt.close(figure)


def report(name: str, out: Path, docs: Path = ROOT / "docs") -> None:
    """Writes the table into the page, and the picture beside it."""
    from tools.marked_part import with_part

    comparison = COMPARISONS[name]
    page = docs / comparison.page
    page.write_text(with_part(page.read_text("utf-8"), writer(name), table(comparison, out)), "utf-8")
    if comparison.picture:
        draw(comparison, out, docs / "figures" / f"{name}.png")
    print(f"wrote {page}")


def main() -> None:
    """Trains with all settings of a comparison, or reports."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", choices=sorted(COMPARISONS))
    parser.add_argument("--out", type=Path, help="folder of its runs; runs/NAME by default")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--report", action="store_true", help="only fill in the page")
    options = parser.parse_args()
    out = (options.out or ROOT / "runs" / options.name).resolve()
    if not options.report:
        work_through(COMPARISONS[options.name], out, options.seeds)
    report(options.name, out)


if __name__ == "__main__":
    main()
