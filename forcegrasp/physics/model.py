"""Compiles the gripper's MJCF for a tier of the physics."""

from __future__ import annotations

from importlib.resources import files

import mujoco

from forcegrasp.errors import ConfigError

#: Seconds between two commands: 25 Hz (paper, Sec. 3).
CONTROL_PERIOD_S = 0.04

# Collision bits of the fast tier: 1 is the pads' contact, 2 the floor's.
_PADS, _FLOOR = 1, 2


def build_model(tier: str) -> mujoco.MjModel:
    """Returns the compiled scene of one grasp.

    Args:
      tier: ``"reference"`` is the paper's scene. ``"fast"`` lets the pads touch a sphere in the cylinder's place, which
        spares the cylinder-box collision that takes half of the engine's time, and doubles the physics step to 4 ms.

    Raises:
      ConfigError: if there is no such tier.
    """
    if tier not in ("reference", "fast"):
        raise ConfigError(f"physics.tier={tier}: must be reference or fast")
    spec = mujoco.MjSpec.from_file(str(files("forcegrasp") / "assets" / "tiago.xml"))
    if tier == "fast":
        _simplify(spec)
    return spec.compile()


def _simplify(spec: mujoco.MjSpec) -> None:
    spec.option.timestep = 0.004
    cylinder = spec.geom("object")
    cylinder.contype, cylinder.conaffinity = _FLOOR, _FLOOR
    floor = spec.geom("floor")
    floor.contype, floor.conaffinity = _FLOOR, _FLOOR
    sphere = spec.body("object").add_geom(
        name="object_pads",
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[cylinder.size[0], 0, 0],
        mass=0,
        contype=_PADS,
        conaffinity=_PADS,
        rgba=[0, 0, 0, 0],
    )
    for name in ("condim", "priority", "friction", "solref", "solimp"):
        setattr(sphere, name, getattr(cylinder, name))
