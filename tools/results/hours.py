"""How long stages take: control steps by the rate of this machine, which is measured in a few seconds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from tools.results.stage import Stage


@dataclass(frozen=True)
class Rates:
    """Control steps per second, of a training on the fast tier and of an evaluation on the reference tier."""

    training: float
    evaluating: float

    def hours(self, stage: Stage) -> float:
        """Rough: presets differ in what they learn from a step."""
        return stage.hours + (stage.trained / self.training + stage.evaluated / self.evaluating) / 3600


def measure_rates(say: Callable[[str], None]) -> Rates:
    """Those of the layers of ``tools.bench``, as busy as the machine is now."""
    from tools.bench.case import Case
    from tools.bench.turns import measure

    # few grasps at once keep the first, unmeasured turn of the slow tier short
    found = measure([Case("training", "fast", 64), Case("transformed env", "reference", 16)], 1, 1.0, say)
    return Rates(*(one.steps_per_second for one in found))
