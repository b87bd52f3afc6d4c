"""Where the time of a diagnosis goes: python tools/profile_diagnosis.py MEASUREMENT_SET"""

from __future__ import annotations

import sys
import time
from collections import defaultdict
from pathlib import Path

from forcegrasp.cli.measuring import refuse_table
from forcegrasp.compare import fit, floor, predict, score, workflow

PARTS = {fit: "fits", score: "signatures of all effects", floor: "numerical floor"}


def main() -> None:
    """Diagnoses the set and prints processor seconds and simulated grasps of each part."""
    spent, simulated = defaultdict(float), defaultdict(int)

    def timed(part: str):
        def run(replay, cases):
            started = time.process_time()
            signals = predict.predict(replay, cases)
            name = f"{part}, {replay.tier} physics"
            spent[name] += time.process_time() - started
            simulated[name] += len(cases) * len(replay.grasps)
            return signals

        return run

    for module, part in PARTS.items():
        vars(module)["predict"] = timed(part)
    loaded = refuse_table(workflow.load(Path(sys.argv[1])), "fit")
    wall, processor = time.perf_counter(), time.process_time()
    diagnosis, _ = workflow.diagnose_set(loaded, None, [], 0, lambda text: None)
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    print(f"{diagnosis.verdict} {', '.join(diagnosis.effects)}: {wall:.0f} s, {processor:.0f} s of processor time")
    for name, seconds in sorted(spent.items(), key=lambda item: -item[1]):
        print(f"  {seconds / processor:4.0%}  {seconds:5.1f} s  {simulated[name]:6,} grasps  {name}")
    print(f"  {1 - sum(spent.values()) / processor:4.0%}  the rest: linear algebra, held-out grasps, null distribution")


if __name__ == "__main__":
    main()
