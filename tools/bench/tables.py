"""What was found, for the terminal."""

from __future__ import annotations

from collections.abc import Iterator

from rich.table import Table

from tools.bench.case import Learning, Measured
from tools.bench.peers import rival
from tools.bench.results import Results


def tables(results: Results) -> Iterator[Table]:
    """A table for each part that was measured."""
    if results.levels:
        yield _levels(results)
    if results.peers:
        yield _peers(results)
    if results.by_grasps:
        yield _growth("frames/s by grasps at once", results.by_grasps, "grasps")
    if results.by_threads:
        yield _growth("frames/s by threads of the physics", results.by_threads, "threads")
    if results.learning:
        yield _learning(results)


def _table(title: str, *headings: str) -> Table:
    table = Table(title=title)
    for number, heading in enumerate(headings):
        table.add_column(heading, justify="right" if number else "left", no_wrap=True)
    return table


def _ratio(above: float | None, below: float | None, form: str = ".2f") -> str:
    return f"{above / below:{form}}" if above and below else "–"


def _memory(found: Measured) -> str:
    return "–" if found.memory_mb is None else f"{found.memory_mb:,.0f}"


def _levels(results: Results) -> Table:
    title = f"What each layer costs, {results.levels[0].case.grasps} grasps at once"
    table = _table(title, "level", "physics", "frames/s", "of the engine", "MB")
    for found in results.levels:
        share = _ratio(results.share_of_engine(found), 1)
        table.add_row(found.case.name, found.case.tier, f"{found.steps_per_second:,.0f}", share, _memory(found))
    return table


def _peers(results: Results) -> Table:
    title = f"Other stacks, {results.processes} processes, {results.peers[0].case.tier} physics"
    table = _table(title, "peer", "frames/s", "MB", "ours, fast", "= stack", "× tier")
    for found in results.peers:
        level = rival(found.case.name)
        fast, same = results.rate(level, "fast"), results.rate(level, found.case.tier)
        ratios = (_ratio(fast, found.steps_per_second, ".1f"), _ratio(same, found.steps_per_second, ".1f"))
        row = (f"{found.steps_per_second:,.0f}", _memory(found), *ratios, _ratio(fast, same, ".1f"))
        table.add_row(found.case.name, *row)
    table.caption = "how many times as fast our transformed env or training is; MB: peak memory"
    return table


def _growth(title: str, measured: list[Measured], axis: str) -> Table:
    counts = sorted({getattr(found.case, axis) for found in measured})
    table = _table(f"{title}, {measured[0].case.tier} physics", "level", *map(str, counts))
    for name in dict.fromkeys(found.case.name for found in measured):
        rates = {getattr(m.case, axis): m.steps_per_second for m in measured if m.case.name == name}
        table.add_row(name, *(f"{rates[count]:,.0f}" if count in rates else "–" for count in counts))
    return table


def _learning(results: Results) -> Table:
    goal = results.learning[0].goal
    heading = ("stack", "physics", f"force reward {goal:g}", "after frames", "frames/s")
    table = _table("Time until a force reward, of training episodes, normalised form", *heading)
    for one in results.learning:
        seconds, frames, _ = one.reached or (one.curve[-1] if one.curve else (0.0, 0, 0.0))
        best = f"not in {one.limit_s:,.0f} s, best {one.best:.1f}"
        verdict = f"in {seconds:,.0f} s" if one.reached else best
        table.add_row(one.name, one.tier, verdict, f"{frames:,}", _ratio(frames, seconds, ",.0f"))
    first, *others = results.learning
    if first.reached:
        table.caption = "\n".join(_slower(first.reached, other) for other in others)
    return table


def _slower(reached: tuple[float, int, float], other: Learning) -> str:
    name = f"{other.name}, {other.tier}"
    if not other.reached:
        return f"{name}: more than {_ratio(other.limit_s, reached[0], '.1f')} times as long"
    seconds, frames, _ = other.reached
    times, more = _ratio(seconds, reached[0], ".1f"), _ratio(frames, reached[1], ".1f")
    return f"{name}: {times} times as long, over {more} times the frames"
