"""The figures of this house, from one command: trains, evaluates, ships, draws, writes tables into pages and cards.

    python -m tools.results plan                  what there is to do, and hours by this machine; begins nothing
    python -m tools.results                       all that is not done; stopped, it goes on where it was
    python -m tools.results --redo outdated       also what other code than today's has made
    python -m tools.results --skip hidden-effects,grippers
    python -m tools.results --only ablation       a stage, or a table or picture by its mark, and what it needs
    python -m tools.results --only pictures --package    of the policies as the package has them: none is trained
    python -m tools.results --seeds 2 --frames 50000 --trials 2    a trial: pages and policies go to OUT/pages
    python -m tools.results check                 fails where a page's figures are older than the code they measure

Each stage notes its commands and the code that it began with. Hours are rough, of the machine as busy as it is.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from forcegrasp.errors import ForcegraspError
from forcegrasp.runs.lock import only_writer
from tools.results import execute
from tools.results.blocks import BLOCKS
from tools.results.notes import SHIP, Notes, State
from tools.results.settings import SEEDS, Settings
from tools.results.stage import Stage


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tools.results", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", nargs="?", choices=("run", "plan", "check"), default="run")
    parser.add_argument("--out", type=Path, help="folder of results (runs/results; of a trial runs/results_trial)")
    parser.add_argument("--only", default="", metavar="NAMES", help="stages, tables or pictures; by commas")
    parser.add_argument("--skip", default="", metavar="NAMES", help="stages to leave out, or pages; by commas")
    parser.add_argument("--package", action="store_true", help="policies as the package has them: none is trained")
    parser.add_argument("--redo", choices=("outdated",), help="begin anew what is not of today's code or commands")
    parser.add_argument("--seeds", type=_count, default=SEEDS, help=f"of each training ({SEEDS})")
    parser.add_argument("--frames", type=_count, help="control steps of each training")
    parser.add_argument("--trials", type=_count, help="grasps in each cell of an evaluation")
    parser.add_argument("--real-data", type=Path, metavar="FOLDER", help="public recordings, see docs/real-data.md")
    options = parser.parse_args(arguments)
    if options.real_data and not options.real_data.is_dir():
        parser.error(f"--real-data {options.real_data}: there is no such folder")
    return options


def _count(text: str) -> int:
    if (number := int(text)) < 1:
        raise argparse.ArgumentTypeError("must be 1 or more")
    return number


def main(arguments: list[str] | None = None) -> int:
    """Reads the command line; returns the exit status."""
    options = parse(arguments)
    if options.what == "check":
        return check()
    from tools.results.stages import stages

    settings = Settings(Path(), options.seeds, options.frames, options.trials, options.real_data)
    out = options.out or Settings.out.with_name("results_trial" if settings.trial else "results")
    settings = Settings(out.resolve(), *(options.seeds, options.frames, options.trials, options.real_data))
    try:
        every = stages(settings)
        chosen = choose(every, _words(options.only), _words(options.skip), options.package)
        notes = Notes(settings.out)
        tell(chosen, notes, settings, options.redo is not None)
        if options.what == "plan":
            return 0
        with only_writer(settings.out / "lock"):
            status = execute.carry_out(chosen, notes, options.redo is not None, say)
            if "pages" not in _words(options.skip):
                from tools.results.pages import write_pages

                write_pages(settings, notes, [stage.name for stage in chosen], say)
    except KeyboardInterrupt:  # while it measured how fast the machine is, or wrote pages
        return execute.INTERRUPTED
    except (ForcegraspError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return status


def choose(every: dict[str, Stage], only: list[str], skip: list[str], package: bool = False) -> list[Stage]:
    """The stages that were asked for, with those that they need, in order; of the policies of the package, none.

    Raises:
      ValueError: if there is no stage, table or picture of a name.
    """
    shown = {block.name: block.stages for block in BLOCKS}
    unknown = [name for name in only if name not in every | shown]
    if unknown := unknown + [name for name in skip if name not in (*every, "pages")]:
        raise ValueError(f"nothing is called {', '.join(unknown)}; there are {', '.join([*every, *shown])}")
    wanted = [stage for name in only for stage in shown.get(name, (name,))] or list(every)
    for name in wanted:  # grows as it is gone through
        wanted += [n for n in every[name].needs if n not in wanted and not (package and n.startswith(SHIP))]
    return [stage for name, stage in every.items() if name in wanted and name not in skip]


def tell(chosen: list[Stage], notes: Notes, settings: Settings, redo: bool) -> None:
    """Each stage's state and hours, and their sum."""
    from tools.results.hours import measure_rates

    states = {stage.name: notes.state(stage) for stage in chosen}
    ahead: list[Stage] = []
    for stage in chosen:
        state = states[stage.name][0]
        made_anew = redo and any(one.name in stage.needs for one in ahead)
        if state in (State.TO_DO, State.BEGUN) or (redo and state is State.OUTDATED) or made_anew:
            ahead.append(stage)
    rates = measure_rates(lambda text: None) if ahead else None
    for stage in chosen:
        state, why = states[stage.name]
        hours = f"{rates.hours(stage):5.1f} h" if rates and stage in ahead else " " * 7
        say(f"{state:9} {hours}  {stage.name}: {stage.makes}" + (f" (made {why})" if why else ""))
    if rates:
        total = sum(rates.hours(stage) for stage in ahead)
        say(
            f"about {total:.1f} hours, at {rates.training:,.0f} control steps/s of training and"
            f" {rates.evaluating:,.0f} of evaluating"
        )
    if settings.trial:
        say(f"a trial: its pages and policies are written to {settings.into}, the repository stays as it is")
    elif not settings.real_data:
        say("left out: docs/real-data.md, without --real-data FOLDER")


def check() -> int:
    """Exit status: 1 if a page or card shows figures of other code than today's."""
    from tools.results.pages import check as found_on_pages

    found = found_on_pages()
    for line in found:
        print(line)
    if found:
        print("Measure anew, for hours: python -m tools.results --redo outdated; until then: --skip results")
    return int(bool(found))


def say(text: str) -> None:
    """A line at once, also where the output is a file."""
    print(text, flush=True)


def _words(text: str) -> list[str]:
    return [word for word in text.split(",") if word]


if __name__ == "__main__":
    sys.exit(main())
