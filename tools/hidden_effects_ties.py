"""Whether the next grasp that a diagnosis proposes settles a tie, beside one of the menu by chance."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from forcegrasp.diagnosis.advice import Advice
    from forcegrasp.diagnosis.result import Diagnosis
    from forcegrasp.replay.next_grasp import NextGrasp
    from tests.independent.rig import Truth

#: So many grasps are recorded, one after the other, each diagnosed together with all before it.
ROUNDS = 2
Choice = Callable[["Advice"], "NextGrasp"]


def settle(folder: Path, truth: Truth, diagnosis: Diagnosis) -> dict[str, list[dict]]:
    """What is told after each further grasp, by how it was chosen: "proposed" or "chance".

    Args:
      folder: holds the set as ``set``; the further ones are written beside it.
      truth: of the set.
      diagnosis: of the set, a tie.
    """
    rng = np.random.default_rng([truth.seed, 6])
    choices: dict[str, Choice] = {
        "proposed": lambda advice: advice.next_grasp,
        "chance": lambda advice: advice.menu[rng.integers(len(advice.menu))],
    }
    return {how: _grasp_by_grasp(folder, how, truth, diagnosis, choose) for how, choose in choices.items()}


def _grasp_by_grasp(folder: Path, how: str, truth: Truth, diagnosis: Diagnosis, choose: Choice) -> list[dict]:
    from forcegrasp.cli.measuring import refuse_table
    from forcegrasp.diagnosis.advice import advise
    from forcegrasp.diagnosis.diagnose_set import diagnose_set
    from forcegrasp.identify.loading import load
    from forcegrasp.identify.verdict import Verdict
    from tests.independent.rig import record_one_more

    sets, told = [folder / "set"], []
    for number in range(1, ROUNDS + 1):
        advice = advise(diagnosis)
        if advice is None:
            break
        one = choose(advice)
        sets.append(folder / f"{how}_{number}")
        commands = one.command(diagnosis.target.gripper)
        record_one_more(sets[-1], truth, one.object, one.offset_m, commands, 1000 * number + truth.seed)
        diagnosis, _ = diagnose_set(refuse_table(load(sets), "fit"), None, [], 0, lambda text: None)
        told.append({"grasp": one.grasp, "verdict": diagnosis.verdict, "effects": list(diagnosis.effects)})
        if diagnosis.verdict is not Verdict.ONE_OF:
            break
    return told
