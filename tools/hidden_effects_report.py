"""Writes the pages of docs/ on hidden effects, and their figures, from the results of tools/hidden_effects.py."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import numpy as np
from matplotlib.figure import Figure
from scipy.stats import binomtest

from tools.hidden_effects_judge import false_names, has_right_term, judge, named_of, settled, steps_of
from tools.measured_code import sentences

DOCS = Path(__file__).resolve().parent.parent / "docs"
SIZES = ("small", "medium", "large")
# A page has a sentence for each of so many versions of the code.
_FEW_CODES = 3


def write(rows: list[dict], jobs: list, right_names: Callable, of_all: bool = False) -> None:
    """Writes the page of grippers, with its figures, and that of servos; not one of which there is no result.

    Each is of the code that measured its last row; or of all code, so that its rates are those of no version.
    """
    right = {job.name: right_names(job) for job in jobs}
    rows = [row for row in rows if row["name"] in right]
    for row in rows:
        row["judged"] = judge(row, right[row["name"]])
        row["right"] = sorted(right[row["name"]])
    servos = [r for r in rows if r["group"].startswith("servo")]
    grippers = [r for r in rows if not r["group"].startswith("servo")]
    if not of_all:
        servos, grippers = _of_last_code(servos), _of_last_code(grippers)
    planned = sum(job.group.startswith("servo") for job in jobs)
    for name, found, text, count in (
        ("hidden-effects", grippers, _page, len(jobs) - planned),
        ("hidden-effects-of-servos", servos, _servo_page, planned),
    ):
        if found:
            (DOCS / f"{name}.md").write_text(text(found, count))
            print(f"wrote docs/{name}.md from {len(found)} of {count} sets")
    (DOCS / "figures").mkdir(parents=True, exist_ok=True)
    for draw, groups in ((_matrix, ("one", "other reading", "law", "outside", "none")), (_power, ("one",))):
        if chosen := [r for r in grippers if r["group"] in groups]:
            draw(chosen)


def _of_last_code(rows: list[dict]) -> list[dict]:
    """The results of the code that measured last."""
    return [r for r in rows if r.get("digest") == rows[-1].get("digest")]


def _measured_with(rows: list[dict]) -> list[str]:
    """Which code the results are of, in a sentence for each, or in one for many."""
    codes = {r.get("digest", "") for r in rows}
    if len(codes) <= _FEW_CODES:
        return sentences(rows)
    return [
        f"Measured with {len(codes)} versions of the code, for most sets an earlier one than the present. What a set",
        "had shown was often mended, and the set measured again: of sets that nobody has met a little less may be",
        "right.",
    ]


def _share(rows: list[dict], *judged: str) -> str:
    return _rate([r["judged"] in judged for r in rows])


def _rate(hits: list[bool]) -> str:
    """How many of all, and the share with its 95 % interval (Wilson)."""
    if not hits:
        return "–"
    found = binomtest(sum(hits), len(hits))
    interval = found.proportion_ci(method="wilson")
    return f"{sum(hits)} of {len(hits)} ({found.statistic:.0%}; {100 * interval.low:.0f}–{100 * interval.high:.0f} %)"


def _known(hits: Iterable[bool | None]) -> str:
    """The rate of those of which it can be said."""
    return _rate([hit for hit in hits if hit is not None])


def _at_floor(rows: list[dict]) -> str:
    """How often no more than 1.1 × the floor is left."""
    return _rate([r["error_after"] <= 1.1 * _floor(r) for r in rows if "error_after" in r])


def _floor(row: dict) -> float:
    """Of noise and numerical error, and of what a clock that is off makes readings differ by."""
    return float(np.hypot(row["floor"], row.get("of_jitter", 0.0)))


def _named(rows: list[dict]) -> list[bool]:
    """Of each thing that is hidden in a set, or wrong with it, whether it is named."""
    return [name in named_of(r, set(r["right"])) for r in rows for name in r["right"]]


def _several_lines(what: str, rows: list[dict]) -> list[str]:
    """How many of the hidden effects are named, and how many of the names are right."""
    named = [step[0] not in false_names(r, set(r["right"])) for r in rows for step in steps_of(r)]
    return [
        f"| {what}: share of them that is named | {_rate(_named(rows))} |",
        f"| … share of names that are right | {_rate(named)} |",
        f"| … error left at most 1.1 × the floor | {_at_floor(rows)} |",
    ]


def _tie_lines(rows: list[dict]) -> list[str]:
    """How often few and plain grasps tell one effect, and how often the next grasps that are proposed do."""
    by_choice = {how: _known(settled(r, set(r["right"]), how) for r in rows) for how in ("proposed", "chance")}
    return [
        f"| one effect, 9 grasps that close and hold: right, or in a right set | {_share(rows, 'first', 'in set')} |",
        f"| … of ties with the right one: it alone is left after two proposed grasps | {by_choice['proposed']} |",
        f"| … after two of the menu by chance | {by_choice['chance']} |",
    ]


def _servo_page(rows: list[dict], planned: int) -> str:
    """The same of logs of a servo."""
    none, one, two = ([r for r in rows if r["group"] == f"servo {kind}"] for kind in ("none", "one", "two"))
    lines = [
        "# How often an effect hidden in a servo's log is found",
        "",
        "A slide without fingers or object (`tests/independent/slide.py`, its own integration and effects): six",
        "recordings of 8 s, with loads from outside, gains that are drawn, and 50 µm of noise. `forcegrasp diagnose`",
        "was given no hints. Of grippers: [how often a hidden effect is found](hidden-effects.md).",
        "",
        "    python tools/hidden_effects.py run --only '^servo'   # half a minute a set",
        "    python tools/hidden_effects.py report                # this page",
        "",
        *_measured_with(rows),
        f"Results of {len(rows)} sets ({planned} in the whole campaign). Rates have 95 % intervals (Wilson).",
        "",
        "| | result |",
        "|---|---|",
        f'| one effect hidden: right one first, or in a right "one of" set | {_share(one, "first", "in set")} |',
        f"| … strictly first | {_share(one, 'first')} |",
        *(
            f"| … {size} effects, first or in the set | {_share(rows, 'first', 'in set')} |"
            for size, rows in ((size, [r for r in one if r["size"] == size]) for size in SIZES)
        ),
        f"| … error left at most 1.1 × the floor | {_at_floor(one)} |",
        f"| two hidden: both named | {_share(two, 'first')} |",
        f"| … at least one of them | {_share(two, 'first', 'in set')} |",
        f"| … error left at most 1.1 × the floor | {_at_floor(two)} |",
        f"| nothing hidden: called explained | {_share(none, 'first')} |",
        f"| nothing hidden: an effect named (false alarm) | {_share(none, 'wrong')} |",
        f"| further effects named besides those that are hidden | {_besides(one + two)} |",
        "",
        *_where_it_went_wrong(rows),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def _besides(rows: list[dict]) -> str:
    """In how many sets something is named that is not there."""
    return _rate([bool(false_names(r, set(r["right"]))) for r in rows])


def _where_it_went_wrong(rows: list[dict]) -> list[str]:
    """A table of the sets of which not all was right first."""
    lines = [
        "## Where it went wrong",
        "",
        "| set | verdict | named | error before → after | left |",
        "|---|---|---|---|---|",
    ]
    for r in rows:
        if r["judged"] != "first":
            named = ", ".join(r.get("effects", [])) or "–"
            errors = f"{r['error_before']:.2f} → {r['error_after']:.2f}" if "error_after" in r else r.get("error", "")
            lines.append(f"| {r['name']} | {r['verdict']} | {named} | {errors} | {r.get('left', '')} |")
    return lines


def _page(rows: list[dict], planned: int) -> str:
    def of(group: str, **wanted) -> list[dict]:
        return [r for r in rows if r["group"] == group and all(r[k] == v for k, v in wanted.items())]

    one, plain_none, noisy = of("one", grasps=24), of("none"), of("noise")
    laws, contacts, several, messy = of("law"), of("contact"), of("several"), of("messy")
    outside, nothing, two_mistakes = of("outside"), plain_none + noisy, of("two mistakes")
    fitted = [r for r in rows if r["group"] in ("one", "none") and r["judged"] == "first"]
    inside, counted = _coverage(fitted)
    ratios = [r["error_after"] / r["floor"] for r in one if r["judged"] == "first"]
    steps = [steps_of(r) for r in one if r["judged"] == "first"]
    more = sum(len(found) > 1 for found in steps)
    lines = [
        "# How often a hidden effect is found",
        "",
        "Measurement sets were recorded by an independent simulator (`tests/independent`: its own scene, 0.5 ms",
        "steps, the newer collision code, its own implementation of every effect), with off-nominal base parameters,",
        "sensor noise of 27 µm and 13 mN, and 24 grasps of a rich plan, 150 samples each. `forcegrasp diagnose` was",
        "given no hints. Sets are taken in random order, so that a part of the campaign is a fair sample of it.",
        "The floor is what noise and half the physics step leave; of a messy rig also what readings differ by because",
        "its rows are read up to 1.5 ms off their time stamps.",
        "Each set's result is a line of `docs/hidden-effects.jsonl`.",
        "",
        "    python tools/hidden_effects.py run      # three minutes of a core a set; goes on where it was stopped",
        "    python tools/hidden_effects.py report   # this page, of the code that measured last; --all: of all code",
        "",
        *_measured_with(rows),
        f"Results of {len(rows)} sets ({planned} in the whole campaign). Rates have 95 % intervals (Wilson).",
        "Of servos: [a page of their own](hidden-effects-of-servos.md). What earlier code did, and what was mended for",
        "it: [a log](hidden-effects-log.md).",
        "",
        "| | result |",
        "|---|---|",
        f'| one effect hidden: right one first, or in a right "one of" set | {_share(one, "first", "in set")} |',
        f"| … strictly first | {_share(one, 'first')} |",
        *(
            f"| … {size} effects, first or in the set | {_share(of('one', grasps=24, size=size), 'first', 'in set')} |"
            for size in SIZES
        ),
        f"| … error left at most 1.1 × the floor | {_at_floor(one)} |",
        f"| … further effects named though only one is hidden | {more} of {len(steps)} |",
        *(
            f"| the same with {count} grasps, {size} effects | {_share(of('one', grasps=count), 'first', 'in set')} |"
            for count, size in ((6, "large"), (10, "medium"), (48, "small"))
        ),
        f"| other honest readings of a catalogue effect | {_share(of('other reading'), 'first', 'in set')} |",
        f"| an effect by another law: its family first, or in the set | {_share(laws, 'first', 'in set')} |",
        f"| … error left at most 1.1 × the floor | {_at_floor(laws)} |",
        f"| another contact, with or without an effect: the family right | {_share(contacts, 'first', 'in set')} |",
        *_several_lines("2 to 5 effects hidden", several),
        *_several_lines("a messy rig, 0 to 3 effects hidden", messy),
        f"| nothing hidden: an effect named (false alarm) | {_share(plain_none, 'wrong')} |",
        f"| nothing hidden: called explained | {_share(plain_none, 'first')} |",
        f"| nothing hidden, odd noise: an effect named | {_share(noisy, 'wrong')} |",
        f"| … called explained | {_share(noisy, 'first')} |",
        f"| a mistake of the set: told as one, or in a tie | {_share(of('spoiled'), 'first', 'in set')} |",
        f"| … an effect named without a doubt | {_share(of('spoiled'), 'wrong')} |",
        f"| two mistakes of the set: share of them that is told | {_rate(_named(two_mistakes))} |",
        f"| … an effect named without a doubt | {_besides(two_mistakes)} |",
        f"| an effect outside the catalogue: called unknown | {_share(outside, 'first')} |",
        f"| … the library of terms has one for it: a law with that term | {_known(map(has_right_term, outside))} |",
        f"| nothing hidden, odd noise or not: a law proposed | {_rate([bool(r.get('law')) for r in nothing])} |",
        *_tie_lines(of("tie")),
        f"| held-out error ÷ floor after adding the right effect, median | {np.median(ratios):.2f} |"
        if ratios
        else None,
        f"| 95 % intervals that hold the true base parameter | {inside / counted:.0%} of {counted} |"
        if counted
        else None,
        "",
        "![confusion matrix](figures/hidden_effects_matrix.png)",
        "",
        "What was hidden (rows) against what was named first (columns).",
        "",
        "![power](figures/hidden_effects_power.png)",
        "",
        "How often each effect is found, by size; where nothing stands none was measured. Sizes are those of",
        "`tests/independent/catalogue.py`; a small one moves some signal by about 3 σ somewhere.",
        "",
        *_what_it_costs(
            {"nothing": plain_none, "one effect": one, "two to five effects": several, "a messy rig": messy}
        ),
        *_where_it_went_wrong(rows),
    ]
    return "\n".join(line for line in lines if line is not None) + "\n"


def _what_it_costs(of: dict[str, list[dict]]) -> list[str]:
    """A table of processor time by what was hidden."""
    lines = [
        "## What a diagnosis costs",
        "",
        "Processor seconds on one thread, whole catalogue, 24 grasps (`tools/profile_diagnosis.py SET` says on what):",
        "",
        "| hidden | sets | median | nine in ten take at most |",
        "|---|---|---|---|",
    ]
    for what, rows in of.items():
        seconds = [r["processor_s"] for r in rows if "processor_s" in r and r["grasps"] == 24]
        if seconds:
            middle, most = np.quantile(seconds, (0.5, 0.9))
            lines.append(f"| {what} | {len(seconds)} | {middle:.0f} | {most:.0f} |")
    return [*lines, ""]


def _coverage(rows: list[dict]) -> tuple[int, int]:
    pairs = [(low <= true <= high) for r in rows for _, true, low, high in r.get("intervals", [])]
    return sum(pairs), len(pairs)


def _matrix(rows: list[dict]) -> None:
    hidden = sorted({"+".join(r["hidden"]) or "none" for r in rows}, key=lambda n: (n not in _catalogue(rows), n))
    named = [
        *sorted({r["effects"][0] for r in rows if r.get("effects")} | _catalogue(rows)),
        "explained",
        "unknown",
        "other",
    ]
    grid = np.zeros((len(hidden), len(named)))
    for r in rows:
        column = r["effects"][0] if r.get("effects") else r["verdict"]
        column = column if column in named else "other"
        grid[hidden.index("+".join(r["hidden"]) or "none"), named.index(column)] += 1
    grid /= np.maximum(grid.sum(axis=1, keepdims=True), 1)
    figure = Figure(figsize=(12, 12), layout="constrained")
    axes = figure.subplots()
    axes.imshow(grid, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    axes.set_xticks(range(len(named)), named, rotation=90)
    axes.set_yticks(range(len(hidden)), hidden)
    axes.set_xlabel("named first, or verdict")
    axes.set_ylabel("hidden")
    for y, x in zip(*np.nonzero(grid), strict=True):
        axes.text(
            x, y, f"{grid[y, x]:.0%}", ha="center", va="center", fontsize=7, color="w" if grid[y, x] > 0.5 else "k"
        )
    figure.savefig(DOCS / "figures" / "hidden_effects_matrix.png", dpi=90)


def _catalogue(rows: list[dict]) -> set[str]:
    return {name for r in rows if r["group"] == "one" for name in r["right"]}


def _power(rows: list[dict]) -> None:
    names = sorted({r["hidden"][0] for r in rows})
    grid = np.full((len(names), len(SIZES)), np.nan)
    for y, name in enumerate(names):
        for x, size in enumerate(SIZES):
            chosen = [r for r in rows if r["hidden"][0] == name and r["size"] == size and r["grasps"] == 24]
            if chosen:
                grid[y, x] = np.mean([r["judged"] in ("first", "in set") for r in chosen])
    figure = Figure(figsize=(6, 7), layout="constrained")
    axes = figure.subplots()
    axes.imshow(grid, cmap="viridis", vmin=0, vmax=1, aspect="auto")
    axes.set_xticks(range(len(SIZES)), SIZES)
    axes.set_yticks(range(len(names)), names)
    axes.set_title("found (first, or in the set)")
    for y, x in zip(*np.nonzero(np.isfinite(grid)), strict=True):
        axes.text(
            x,
            y,
            f"{grid[y, x]:.0%}",
            ha="center",
            va="center",
            fontsize=8,
            color="black" if grid[y, x] > 0.6 else "white",
        )
    figure.savefig(DOCS / "figures" / "hidden_effects_power.png", dpi=90)
