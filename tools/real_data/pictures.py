"""Pictures of what was found: where it helps most, without and with it, and how the held-out errors fall."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tools.real_data.judge import best_model, whole, windows
from tools.real_data.study import Study

_MEASURED, _WITHOUT, _WITH = "0.25", "#c7622b", "#2c6fbb"
#: Seconds that are shown of a recording that was replayed whole.
_SHOWN_S = 2.5


@dataclass(frozen=True)
class Shown:
    """A piece of one recording: measured, and replayed without and with what was found. ``(T,)`` each."""

    time_s: np.ndarray
    measured: np.ndarray
    without: np.ndarray
    having: np.ndarray
    axis: str


def of_whole(check: Path, diagnosis: Path, channel: int, scale: float, axis: str) -> Shown:
    """Where the squares fall most in recordings that were replayed from start to end."""
    base, best = whole(check, diagnosis / "base_model.yaml"), whole(check, best_model(diagnosis))
    best_fall, shown = -np.inf, None
    for (time, seen, before), (_, _, after) in zip(base, best, strict=True):
        fall = np.cumsum((seen - before)[:, channel] ** 2 - (seen - after)[:, channel] ** 2)
        count = min(len(time) - 1, int(_SHOWN_S / float(np.median(np.diff(time)))))
        low = int(np.argmax(fall[count:] - fall[:-count]))
        if fall[low + count] - fall[low] > best_fall:
            best_fall, part = fall[low + count] - fall[low], slice(low, low + count)
            measured, without, having = (scale * s[part, channel] for s in (seen, before, after))
            shown = Shown(time[part], measured, without, having, axis)
    assert shown is not None
    return shown


def of_windows(measured: Path, diagnosis: Path, scale: float, axis: str) -> Shown:
    """The window whose squares fall most."""
    base, best = windows(measured, diagnosis / "base_model.yaml"), windows(measured, best_model(diagnosis))
    before, after = ((np.where(w.counts, (w.measured - w.predicted)[..., 0], 0.0) ** 2).sum(1) for w in (base, best))
    k = int(np.argmax(before - after))
    count = len(base.time_s[k])
    seen, without, having = (scale * s[k, :count, 0] for s in (base.measured, base.predicted, best.predicted))
    return Shown(base.time_s[k], seen, without, having, axis)


def draw(study: Study, shown: Shown, file: Path, labels: tuple[str, str] = ("without", "with")) -> None:
    """The piece, what is left of it, and the errors on held-out recordings before and after."""
    figure = Figure(figsize=(10.5, 4.6), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(2.6, 1), height_ratios=(1.7, 1))
    above, errors = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[:, 1])
    below = figure.add_subplot(grid[1, 0], sharex=above)
    words = ", ".join(name.replace("_", " ") for name in study.found) or "nothing"
    above.plot(shown.time_s, shown.measured, ".", color=_MEASURED, ms=2.5, alpha=0.6, label="recorded")
    lines = ((shown.without, _WITHOUT, f"model {labels[0]}"), (shown.having, _WITH, f"model {labels[1]} {words}"))
    for values, colour, name in lines:
        above.plot(shown.time_s, values, color=colour, lw=1.2, label=name)
        below.plot(shown.time_s, shown.measured - values, color=colour, lw=1)
    below.axhline(0, color="0.6", lw=0.6)
    above.set_ylabel(shown.axis)
    below.set_ylabel("recorded − model")
    below.set_xlabel("time [s]")
    figure.suptitle(study.title, x=0.01, ha="left", fontsize=11)
    above.legend(frameon=False, fontsize=8, ncols=3, loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0)
    rows = [e for e in study.errors if np.isfinite(e.before)]
    place = np.arange(len(rows))
    for k, (key, colour) in enumerate((("before", _WITHOUT), ("after", _WITH))):
        shares = [getattr(e, key) / e.before for e in rows]
        errors.barh(place + 0.38 * k, shares, 0.34, color=colour)
        for y, e, share in zip(place + 0.38 * k, rows, shares, strict=True):
            right = max(share, (e.yardstick or 0.0) / e.before) + 0.03  # of bar and line
            told = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
            errors.text(right, y, f"{getattr(e, key):.3g} {e.unit}", va="center", fontsize=8, bbox=told)
    for y, e in zip(place, rows, strict=True):
        if e.yardstick:
            errors.plot([e.yardstick / e.before] * 2, [y - 0.2, y + 0.58], color="k", lw=1.2)
    errors.set_yticks(place + 0.19, [e.signal.replace("_", " ") for e in rows], fontsize=8)
    errors.invert_yaxis()
    errors.set_xlim(0, 1.3 * max([1.0, *(e.after / e.before for e in rows)]))
    errors.set_xticks([])
    yard = " (line: the authors' model)" if any(e.yardstick for e in rows) else ""
    errors.set_title(f"rms held out{yard}", fontsize=9)
    for axes in (above, below, errors):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(file, dpi=140)


def draw_all(studies: list[Study], out: Path, folder: Path) -> None:
    """A picture of each study that found something, and the first one again as the README's."""
    for study in (study for study in studies if study.found):
        at = out / study.name
        if study.name == "emps":
            shown = of_whole(at / "check", at / "diagnosis", 1, 1.0, "force of the drive [N]")
        elif study.name == "xl330":
            shown = of_whole(at / "check", at / "diagnosis", 0, 1.0, "position [rad]")
        else:
            shown = of_windows(at / "set", at / "diagnosis", 1.0, "position [rad]")
        draw(study, shown, folder / f"real_{study.name}.png")
        if study.name == "emps":
            draw(study, shown, folder / "real_first.png")
