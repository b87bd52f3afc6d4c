"""Does the simulator compute what it did when it was approved, and can something render it?"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator

from forcegrasp.doctor.child import run_python
from forcegrasp.doctor.finding import Finding, fine, mend, note, warning

#: Positions (m) and forces (N) of both fingers at the end of the grasp below; the first of ``tests/golden``.
KNOWN = {
    "reference": ((0.018816480, 0.018814660), (1.525113, 1.485271)),
    "fast": ((0.018788274, 0.018788274), (1.521927, 1.486833)),
}
#: Rounding moves the reference tier's contact points a little from machine to machine, see ``tools/golden.py``.
TOLERANCES = (2e-6, 0.03)
#: Closes at full speed on a hard object and squeezes it.
_GRASP = """
import json
import numpy as np
from forcegrasp.physics import GraspParameters, GraspSimulator
ends = {}
for tier in ("reference", "fast"):
    simulator = GraspSimulator(1, tier, threads=1)
    simulator.reset(GraspParameters([0.0], [-9.0], [0.020], [0.0], [0.1]))
    for _ in range(120):
        simulator.step(np.full((1, 2), -0.003))
    ends[tier] = simulator.joint_position[0].tolist(), simulator.force[0].tolist()
print(json.dumps(ends))
"""
_RENDER = """
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
with mujoco.Renderer(model, 16, 16) as renderer:
    renderer.update_scene(mujoco.MjData(model))
    renderer.render()
print("rendered")
"""


def check_physics() -> Iterator[Finding]:
    """One grasp on both tiers, against known numbers."""
    child = run_python("-c", _GRASP)
    if child.failure:
        yield mend("physics", f"a grasp can't be simulated ({child.failure})", "see what is said of MuJoCo and imports")
        return
    ends = json.loads(child.output)
    wrong = []
    for tier, known in KNOWN.items():
        for end, right, tolerance, unit in zip(ends[tier], known, TOLERANCES, ("m", "N"), strict=True):
            if not all(abs(a - b) <= tolerance for a, b in zip(end, right, strict=True)):
                now, then = (" and ".join(f"{value:.6g}" for value in pair) for pair in (end, right))
                wrong.append(f"{tier}: {now} {unit} instead of {then} {unit}")
    if wrong:
        told = f"a known grasp ends differently ({'; '.join(wrong)}), so results can't be compared"
        yield mend("physics", told, "install the version of MuJoCo that is needed, in a fresh environment")
    else:
        yield fine("physics", f"a known grasp ends with {ends['reference'][1][0]:.3f} N, as it should")


def check_renderer() -> Iterator[Finding]:
    """What videos are made with: tried in turn in a process each, as videos are."""
    from forcegrasp.physics.scene_renderer import backends, no_renderer

    asked = os.environ.get("MUJOCO_GL")
    if asked in ("disable", "disabled", "off", "false", "0"):
        yield note("videos", f"none, as MUJOCO_GL={asked} asks", "unset MUJOCO_GL if you want them")
        return
    for backend in backends():
        if "rendered" in run_python("-c", _RENDER, MUJOCO_GL=backend).output:
            yield fine("videos", f"rendered with {backend}")
            return
    told = f"nothing renders ({', '.join(backends())} tried); all else works without"
    yield warning("videos", told, no_renderer().partition("; ")[2])
