"""Where the time of a diagnosis goes: python tools/profile_diagnosis.py MEASUREMENT_SET [--threads 1]"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from types import FrameType

from mujoco.batch import Batch

from forcegrasp.cli.measuring import refuse_table
from forcegrasp.diagnosis import signatures
from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.diagnosis.faults import odd_grasps, suspects, tolerance
from forcegrasp.diagnosis.givens import moved_set
from forcegrasp.diagnosis.search import exchange, merge, needless, split
from forcegrasp.diagnosis.search.finalists import Finalists
from forcegrasp.diagnosis.search.refine import refine, refine_anyway
from forcegrasp.diagnosis.search.rough_fits import RoughFits
from forcegrasp.identify.base_fit import fit_base
from forcegrasp.identify.cross_validation import heldout_residual
from forcegrasp.identify.loading import load
from forcegrasp.identify.noise_floor import numerical_error
from forcegrasp.replay import replay
from forcegrasp.replay.replay import Replay

#: Code of functions that simulate → what they do it for; the innermost one that is running counts.
PARTS = {
    fit_base.__code__: "base model, from several starts",
    numerical_error.__code__: "numerical floor",
    signatures.Signatures.simulate.__code__: "signatures of all effects",
    signatures.best_sizes.__code__: "sizes around the best signatures",
    refine.__code__: "rough fits with one more effect",
    Finalists.fitted.__code__: "fits of the best ones to the end",
    RoughFits.of_richer.__code__: "fits with richer effects in place of known ones",
    needless.drop_needless.__code__: "fits without known effects",
    heldout_residual.__code__: "held-out grasps",
    odd_grasps.odd_grasps.__wrapped__.__code__: "odd grasps",
    refine_anyway.__code__: "rough fits with effects that promise little",
    exchange.exchange.__code__: "effects in place of known ones",
    split.split.__code__: "two effects in place of one",
    merge.merge.__code__: "one effect in place of two",
    needless.simplify.__code__: "simpler effects",
    moved_set.go_on_with_moved.__code__: "what is given, moved",
    suspects.suspects.__code__: "mistakes of the set",
    tolerance.wanted_moves.__code__: "how far what is given is to be moved",
}


def part_of(frame: FrameType | None) -> str:
    """Which part of a diagnosis is running, from the call stack below the simulator."""
    while frame is not None:
        if frame.f_code in PARTS:
            return PARTS[frame.f_code]
        frame = frame.f_back
    return "other"


def watch(cls: type, name: str, report: Callable[..., None]) -> None:
    """Reports the processor seconds of each call of a method, with the object and its first argument."""
    method = getattr(cls, name)

    def timed(self, *args, **options):
        started = time.process_time()
        result = method(self, *args, **options)
        report(time.process_time() - started, self, *args[:1])
        return result

    setattr(cls, name, timed)


def main() -> None:
    """Diagnoses the set; prints processor seconds, simulated grasps and their seconds, part by part."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("set", type=Path)
    parser.add_argument("--threads", type=int, default=1, help="threads of the engine; 0 uses every core")
    arguments = parser.parse_args()
    replay.THREADS = arguments.threads
    spent, grasps, engine = defaultdict(float), defaultdict(int), [0.0]

    def simulated(seconds: float, of: Replay, rows) -> None:
        part = f"{part_of(sys._getframe(2))}, {of.tier} physics"
        spent[part] += seconds
        grasps[part] += len(rows)

    def stepped(seconds: float, *_) -> None:
        engine[0] += seconds

    watch(Replay, "simulate", simulated)
    for name in ("step", "rollout"):
        watch(Batch, name, stepped)
    loaded = refuse_table(load(arguments.set), "fit")
    wall, processor = time.perf_counter(), time.process_time()
    diagnosis, _ = diagnose_set(loaded, None, [], 0, lambda text: None)
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    print(f"{diagnosis.verdict} {', '.join(diagnosis.effects)}: {wall:.0f} s, {processor:.0f} s of processor time")
    for name, seconds in sorted(spent.items(), key=lambda item: -item[1]):
        print(f"  {seconds / processor:4.0%}  {seconds:5.1f} s  {grasps[name]:6,} grasps  {name}")
    print(f"  {1 - sum(spent.values()) / processor:4.0%}  the rest: sensors, linear algebra")
    print(f"{engine[0] / processor:.0%} of it in MuJoCo")


if __name__ == "__main__":
    main()
