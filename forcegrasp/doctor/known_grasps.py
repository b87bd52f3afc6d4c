"""A grasp of each gripper that comes with the package, and how it ended when the physics was approved.

python -c 'from forcegrasp.doctor.known_grasps import main; main()' > known_grasps.json    (of forcegrasp/assets)
"""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any

STEPS = 120
TIERS = ("reference", "fast")


def known_grasps() -> dict[str, dict[str, Any]]:
    """Gripper → what :func:`simulate` returned."""
    return json.loads((files("forcegrasp.assets") / "known_grasps.json").read_text("utf-8"))


def simulate(name: str) -> dict[str, Any]:
    """Closes a gripper at full speed on a small hard object and squeezes it.

    Returns:
      Of each tier, positions of the motors (m or rad) and forces of both fingers (N) at the end; and the ``unit`` of
      the positions.
    """
    import numpy as np

    from forcegrasp.physics import GraspParameters, GraspSimulator, load_gripper

    gripper = load_gripper(name)
    training = gripper.training
    offset = sum(training.start_offset_m) / 2
    grasp = GraspParameters(*np.array([[0.0], [gripper.nominal_gain], [training.start_radius_m[0]], [offset], [0.1]]))
    found: dict[str, Any] = {"unit": gripper.unit}
    for tier in TIERS:
        simulator = GraspSimulator(1, tier, threads=1, gripper=gripper)
        simulator.reset(grasp)
        for _ in range(STEPS):
            simulator.step(np.full((1, len(gripper.motors)), -gripper.max_step))
        found[tier] = [np.round(end[0], 9).tolist() for end in (simulator.joint_position, simulator.force)]
    return found


def main() -> None:
    """Prints the grasps of all grippers as JSON, a line each."""
    from forcegrasp.physics import shipped_grippers

    start = "{"
    for name in shipped_grippers():
        print(f"{start}{json.dumps(name)}: {json.dumps(simulate(name))}", end="", flush=True)
        start = ",\n"
    print("}")
