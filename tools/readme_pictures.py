"""Makes the README's moving pictures: one grasp by two controllers, and an error that falls once an effect is added.

    python tools/readme_pictures.py [--out docs/figures]

Everything is simulated and fitted anew by the commands that the README shows: a minute and a half on one core.
grasp.gif needs OpenGL without a display (on Debian libegl1 or libosmesa6); where there is none, nothing is written.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from forcegrasp.cli.main import main as forcegrasp
from forcegrasp.cli.measuring import refuse_table
from forcegrasp.evaluate.plots import figure_pixels
from forcegrasp.identify.comparison import Comparison, compare
from forcegrasp.identify.cross_validation import rms
from forcegrasp.identify.loading import load
from forcegrasp.identify.phases import PHASES
from forcegrasp.models.model_file import read_model
from forcegrasp.reports.figures import MEASURED, WITH, WITHOUT

FIGURES = Path(__file__).resolve().parent.parent / "docs" / "figures"
GRASP = ["render", "policies=[ib,force_pi]", "kappa=0.8"]
LOOP = (
    ["record", "grasps=20", "objects=3", "seed=3", "effects=['backlash gap_m=0.0006']", "out=my_set"],
    ["fit", "data=my_set", "out=model.yaml"],
    ["add", "data=my_set", "model=model.yaml", "effect=backlash", "out=better.yaml"],
)
#: Pictures between the model without and the one with the effect; how long each is shown, and the first and last, ms.
STEPS, STEP_MS, FIRST_MS, LAST_MS = 30, 70, 2500, 4000
_COLOURS = 64


def call(arguments: list[str]) -> None:
    """Runs ``forcegrasp ...``, which says itself what is wrong.

    Raises:
      SystemExit: with its exit status, if it failed.
    """
    if status := forcegrasp(arguments):
        raise SystemExit(status)


def compared() -> tuple[Comparison, Comparison]:
    """Records, fits and adds in the working directory; returns the set beside both models."""
    for arguments in LOOP:
        call(arguments)
    loaded = refuse_table(load(Path("my_set")), "compare")
    before, after = (compare(loaded, read_model(Path(name)), 0, print)[0] for name in ("model.yaml", "better.yaml"))
    return before, after


def pictures_of_fall(before: Comparison, after: Comparison, effect: str, steps: int = STEPS) -> list[np.ndarray]:
    """The pictures of the moving one: the model with the effect takes the place of the one without.

    Args:
      before: the measurements beside the model without the effect.
      after: the same measurements beside the model with it.
      effect: its name.
      steps: pictures after the first.

    Returns:
      RGB pictures ``(height, width, 3)``, the first without the effect, the last with it.
    """
    return [figure_pixels(_draw(before, after, effect, step / steps)) for step in range(steps + 1)]


def _draw(before: Comparison, after: Comparison, effect: str, share: float) -> Figure:
    """One picture: the model with the effect up to ``share`` of the time shown, the one without from there on."""
    target = before.target
    index, side = _clearest(before, after)
    keep = target.mask[index]
    time = target.grasps[index].time_s - target.grasps[index].time_s[0]
    measured = target.signals[index][keep]
    without, having = (measured - c.heldout[index][keep] * target.sigma for c in (before, after))
    span = _parted(time, np.abs(without - having)[:, side])
    now = span[0] + share * (span[1] - span[0])
    figure = Figure(figsize=(8.8, 3.2), dpi=100)
    for left, title, signal, factor in (
        (0.055, "finger's position [mm]", side, 1e3),
        (0.385, "its force [N]", 2 + side, 1.0),
    ):
        axes = figure.add_axes((left, 0.15, 0.27, 0.59))
        curves = [factor * signals[:, signal] for signals in (measured, without, having)]
        _draw_signal(axes, time, curves, span, now)
        _tidy(axes, title, "time [s]")
    _draw_bars(figure.add_axes((0.775, 0.15, 0.21, 0.59)), before, after, share)
    errors = [f"error {rms(c.heldout, target):.1f} × sensor noise" for c in (before, after)]
    ends = {0.0: (f"Model without {effect}: {errors[0]}", WITHOUT), 1.0: (f"Model with {effect}: {errors[1]}", WITH)}
    text, colour = ends.get(share, (f"Adding {effect} …", MEASURED))
    figure.text(0.012, 0.97, text, fontsize=13, weight="bold", va="top", color=colour)
    key = "dots: measured · lines: predicted for grasps that were held out of the fit"
    figure.text(0.012, 0.89, key, fontsize=9, va="top", color=MEASURED)
    return figure


def _draw_signal(axes: Axes, time: np.ndarray, curves: list[np.ndarray], span: tuple[float, float], now: float) -> None:
    """One signal over ``span``: measured, and predicted with the effect until ``now`` and without it afterwards."""
    measured, without, having = curves
    done, seen = time <= now, (time >= span[0]) & (time <= span[1])
    axes.plot(time, measured, ".", color=MEASURED, ms=4)
    axes.plot(time, without, "--", color=WITHOUT, lw=1.2, alpha=0.35)
    axes.plot(time[~done], without[~done], "--", color=WITHOUT, lw=1.6)
    axes.plot(time[done], having[done], color=WITH, lw=1.6)
    if span[0] < now < span[1]:
        axes.axvline(now, color="0.6", lw=1)
    shown = np.concatenate([curve[seen] for curve in curves])
    axes.set_xlim(span)
    axes.set_ylim(shown.min() - 0.05 * np.ptp(shown), shown.max() + 0.05 * np.ptp(shown))


def _clearest(before: Comparison, after: Comparison) -> tuple[int, int]:
    """The grasp and the finger, left 0 or right 1, whose position and force an effect makes most alike."""
    fall = np.sum(before.heldout**2 - after.heldout**2, axis=1)
    by_finger = fall[:, :2] + fall[:, 2:]
    index, side = np.unravel_index(np.nanargmax(by_finger), by_finger.shape)
    return int(index), int(side)


def _parted(time: np.ndarray, apart: np.ndarray) -> tuple[float, float]:
    """When two predictions differ: on the whole way of a finger nothing would be seen."""
    where = time[apart > 0.15 * apart.max()]
    return max(where[0] - 0.3, time[0]), min(where[-1] + 0.3, time[-1])


def _draw_bars(axes: Axes, before: Comparison, after: Comparison, share: float) -> None:
    """Held-out error ÷ noise of each phase, on its way from one model to the other."""
    target = before.target
    inside = [(target.phase == phase)[:, :, None] for phase in range(len(PHASES))]
    without, having = (np.array([rms(c.heldout, target, where) for where in inside]) for c in (before, after))
    rows = np.arange(len(PHASES))
    axes.barh(rows, without, color=WITHOUT, alpha=0.25)
    axes.barh(rows, without + share * (having - without), color=WITH if share == 1 else WITHOUT)
    axes.axvline(1, color=MEASURED, lw=1, ls=":")
    axes.set_yticks(rows, [phase.replace("_", "\n") for phase in PHASES])
    axes.invert_yaxis()
    _tidy(axes, "error ÷ noise", "dotted: noise alone")


def _tidy(axes: Axes, title: str, xlabel: str) -> None:
    axes.set_title(title, fontsize=10, loc="left")
    axes.set_xlabel(xlabel, fontsize=9, labelpad=1)
    axes.tick_params(labelsize=9)
    axes.spines[["top", "right"]].set_visible(False)


def write_gif(pictures: list[np.ndarray], path: Path) -> None:
    """Writes pictures as a GIF that starts over and over, in colours that all of them share."""
    images = [Image.fromarray(picture) for picture in pictures]
    some = np.concatenate([pictures[0], pictures[len(pictures) // 2], pictures[-1]])
    palette = Image.fromarray(some).quantize(_COLOURS)
    first, *rest = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images)
    durations = [FIRST_MS, *[STEP_MS] * (len(rest) - 1), LAST_MS]
    first.save(path, "GIF", save_all=True, append_images=rest, duration=durations, loop=0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=FIGURES)
    out = parser.parse_args().out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    call([*GRASP, f"out={out / 'grasp.gif'}"])
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        pictures = pictures_of_fall(*compared(), effect="backlash")
    write_gif(pictures, out / "error_falls.gif")
    for name in ("grasp.gif", "error_falls.gif"):
        print(f"{out / name}: {(out / name).stat().st_size / 1e6:.2f} MB", file=sys.stderr)


if __name__ == "__main__":
    main()
