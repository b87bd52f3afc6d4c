"""Does the simulator compute what it did when it was approved, and can something render it?"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from typing import Any

from forcegrasp.doctor.child import run_python
from forcegrasp.doctor.finding import Finding, fine, mend, note, warning
from forcegrasp.doctor.known_grasps import TIERS, known_grasps

#: Rounding moves the reference tier's contact points a little from machine to machine, see ``tools/golden.py``:
#: a share of the positions, and newtons.
POSITION_TOLERANCE, FORCE_TOLERANCE_N = 1e-4, 0.03
_RENDER = """
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
with mujoco.Renderer(model, 16, 16) as renderer:
    renderer.update_scene(mujoco.MjData(model))
    renderer.render()
print("rendered")
"""


def check_physics() -> Iterator[Finding]:
    """One grasp of each gripper that comes with the package, on both tiers, against known numbers."""
    known = known_grasps()
    child = run_python("-c", "from forcegrasp.doctor.known_grasps import main; main()")
    if child.failure:
        about = next((name for name in known if f'"{name}"' not in child.output), "the package's grippers")
        told = f"a grasp can't be simulated ({child.failure}, with {about})"
        yield mend("physics", told, "see what is said of MuJoCo and imports")
        return
    found = json.loads(child.output)
    wrong = [text for name in known for tier in TIERS for text in _unlike(name, tier, found[name], known[name])]
    if wrong:
        told = f"known grasps end differently ({'; '.join(wrong)}), so results can't be compared"
        yield mend("physics", told, "install the version of MuJoCo that is needed, in a fresh environment")
    else:
        forces = ", ".join(f"{name} with {now['reference'][1][0]:.3f} N" for name, now in found.items())
        yield fine("physics", f"a known grasp of each gripper ends as it should: {forces}")


def _unlike(name: str, tier: str, found: dict[str, Any], known: dict[str, Any]) -> Iterator[str]:
    """How the end of a gripper's grasp differs from the known one."""
    for now, right, unit in zip(found[tier], known[tier], (known["unit"], "N"), strict=True):
        limits = [FORCE_TOLERANCE_N if unit == "N" else POSITION_TOLERANCE * abs(value) for value in right]
        if not all(abs(a - b) <= limit for a, b, limit in zip(now, right, limits, strict=True)):
            end, then = (" and ".join(f"{value:.6g}" for value in values) for values in (now, right))
            yield f"{name}, {tier}: {end} {unit} instead of {then} {unit}"


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
