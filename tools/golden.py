"""Golden trajectories: what the simulator did when it was last approved, in ``tests/golden``.

    python tools/golden.py --check    compares the simulator with them
    python tools/golden.py --write    replaces them; only when the physics is meant to change: say why in the commit

One grasp per way of closing, on both tiers. On the machine that wrote them the simulator repeats them to the last
digit; elsewhere the maths library may round differently. The fast tier hardly minds. Until a grasp's first touch
neither does the reference tier, but then it picks contact points discontinuously: noise of 1e-15 to 1e-10 in the
actions moved its forces by up to 13 mN (1.2 mN on average over a grasp) and positions by 1 µm. The tolerances are
about twice that.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from forcegrasp.physics import GraspParameters, GraspSimulator

FOLDER = Path(__file__).parents[1] / "tests" / "golden"
TIERS = ("reference", "fast")
COLUMNS = ("grasp", "step", "q_l_m", "q_r_m", "f_l_n", "f_r_n", "object_y_m")
STEPS, EVERY, MAX_DELTA_M = 120, 4, 0.003
#: What is compared → the tolerance, metres and newtons.
TOLERANCES = {
    "reference": {"steps": 0, "free positions": 1e-9, "positions": 2e-6, "forces": 0.03, "mean forces": 2.5e-3},
    "fast": {"steps": 0, "free positions": 1e-9, "positions": 1e-9, "forces": 1e-6, "mean forces": 1e-7},
}
GRASPS = GraspParameters(
    kappa=np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0]),
    b2=np.array([-9.0, -13.0, -11.0, -9.0, -7.5, -6.0]),
    radius_m=np.array([0.020, 0.035, 0.031, 0.026, 0.030, 0.033]),
    offset_m=np.array([0.0, 0.004, -0.008, 0.012, 0.0, -0.005]),
    goal_force_n=np.full(6, 0.1),
)


def script() -> np.ndarray:
    """Actions in [−1, 1] of every grasp, ``(STEPS, 6, 2)``."""
    t = np.arange(STEPS)
    ramp, wave = t / STEPS, np.sin(t / 8)
    ways = [
        (-1 + 0 * t, -1 + 0 * t),  # closes at full speed and squeezes
        (-0.6 - 0.4 * ramp, -0.3 - 0.7 * ramp),  # one finger faster than the other, ever harder
        (-0.8 + 0 * t, 0 * t),  # one finger pushes the object
        (np.where(t < 50, -1, -0.2), np.where(t < 50, -1, -0.9)),  # holds with unequal deltas
        (np.where((t > 45) & (t < 75), 0.8, -0.7),) * 2,  # closes, opens, closes
        (-0.5 + 0.4 * wave, -0.5 - 0.4 * wave),  # to and fro
    ]
    return np.stack([np.stack(pair, axis=1) for pair in ways], axis=1)


def simulate(tier: str) -> np.ndarray:
    """One row per grasp and recorded step, see :data:`COLUMNS`."""
    n = len(GRASPS)
    simulator = GraspSimulator(n, tier, threads=1)
    simulator.reset(GRASPS)
    rows = []
    for step, action in enumerate(script()):
        simulator.step(action * MAX_DELTA_M)
        if step % EVERY == EVERY - 1:
            state = simulator.joint_position, simulator.force, simulator.object_position[:, None]
            rows.append(np.column_stack([np.arange(n), np.full(n, step), *state]))
    return np.stack(rows, axis=1).reshape(-1, len(COLUMNS))


def path(tier: str) -> Path:
    """Where a tier's trajectories are kept."""
    return FOLDER / f"{tier}.csv"


def write(tier: str) -> None:
    """Approves what the simulator does now."""
    lines = [",".join(f"{value:.13g}" for value in row) for row in simulate(tier)]
    path(tier).write_text("\n".join([",".join(COLUMNS), *lines]) + "\n")


def deviations(now: np.ndarray, golden: np.ndarray) -> dict[str, float]:
    """Largest deviations, by the names of :data:`TOLERANCES`."""
    now, golden = (table.reshape(len(GRASPS), -1, len(COLUMNS)) for table in (now, golden))
    difference = np.abs(now - golden)
    positions, forces = difference[..., [2, 3, 6]], difference[..., 4:6]
    free = np.cumsum(golden[..., 4:6].any(axis=-1), axis=1) == 0
    return {
        "steps": difference[..., :2].max(),
        "free positions": positions[free].max(),
        "positions": positions.max(),
        "forces": forces.max(),
        "mean forces": forces.mean(axis=(1, 2)).max(),
    }


def read(tier: str) -> np.ndarray:
    """The approved rows."""
    return np.loadtxt(path(tier), delimiter=",", skiprows=1)


def beyond(tier: str, found: dict[str, float]) -> list[str]:
    """Names of the deviations that exceed their tolerance; NaN does."""
    return [what for what, deviation in found.items() if not deviation <= TOLERANCES[tier][what]]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_mutually_exclusive_group(required=True)
    verbs.add_argument("--check", action="store_true")
    verbs.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    failed = False
    for tier in TIERS:
        if arguments.write:
            write(tier)
        found = deviations(simulate(tier), read(tier))
        bad = beyond(tier, found)
        failed |= bool(bad)
        for what, deviation in found.items():
            verdict = "FAILED" if what in bad else "ok"
            print(f"{tier:10}{what:15}{deviation:8.1e} ≤ {TOLERANCES[tier][what]:.1e}  {verdict}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
