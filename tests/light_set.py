"""Sets of a gripper that takes a tenth of TIAGo's time to simulate, for tests that fit and diagnose many."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.predict import Case, predict
from forcegrasp.measure import MeasuredGrasp, MeasurementSet
from forcegrasp.measure.schema import fingerprint_of_set
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.replay.record import parse_effect
from forcegrasp.replay.replay import Replay
from tests.independent.plan import draw_setup
from tests.independent.rig import FORCE_STD_N, POSITION_STD_M
from tests.independent.scene import SAMPLE_S


@cache
def light_gripper() -> Gripper:
    """Two fingers like TIAGo's around a ball."""
    return load_gripper(str(Path(__file__).parent / "grippers" / "light.yaml"))


def light_set(
    *hidden: str,
    seed: int = 2,
    grasps: int = 9,
    samples: int = 72,
    sensor: Callable[[np.ndarray], np.ndarray] = np.asarray,
) -> Loaded[MeasurementSet]:
    """The grasps that the rig of :mod:`tests.independent.rig` would make, by the light gripper.

    Args:
      hidden: effects that act, such as ``"command_delay delay_s=0.003"``.
      seed: of the plan, the gripper's parameters and the noise.
      grasps: how many.
      samples: of each, 40 ms apart.
      sensor: what the force sensors make of the force, but for noise.
    """
    gripper, setup = light_gripper(), draw_setup(seed, grasps, "rich", samples)
    radius, rest, unloaded = setup.per_grasp("radius"), np.full((samples, 2), gripper.stroke), np.zeros((samples, 2))
    bare = [
        MeasuredGrasp(
            str(i), setup.things[thing].name, str(setup.session[i]), radius[i], setup.offset[i], None,
            SAMPLE_S * np.arange(samples), setup.commands[i], rest, unloaded, None,
        )
        for i, thing in enumerate(setup.thing)
    ]  # fmt: skip
    base = {name: np.full(grasps, parameter.nominal) for name, parameter in gripper.parameters.items()}
    base |= {"position_gain": np.full(grasps, setup.servo.gain), "velocity_gain": np.full(grasps, setup.servo.b2)}
    # one contact per finger where TIAGo's pads make ten: to give way as much it has to be half as deep
    base |= {"rho_m": 0.5 * setup.per_grasp("rho"), "force_scale": setup.per_grasp("f_alpha")}
    base |= {"radius_m": radius, "offset_m": setup.offset}
    effects = tuple(parse_effect(text, gripper) for text in hidden)
    (true,) = predict(Replay(gripper, bare, encoders_known=False, strict=True), [Case(base, effects)])
    true = np.concatenate([true[..., :2], sensor(true[..., 2:])], axis=2)
    rng = np.random.default_rng([seed, 2])
    read = true + rng.standard_normal(true.shape) * [POSITION_STD_M, POSITION_STD_M, FORCE_STD_N, FORCE_STD_N]
    found = tuple(
        dataclasses.replace(g, position_m=one[:, :2], force_n=one[:, 2:]) for g, one in zip(bare, read, strict=True)
    )
    name, noise = gripper.name_or_path, (POSITION_STD_M, FORCE_STD_N)
    digest = fingerprint_of_set(name, *noise, found)
    return Loaded(MeasurementSet(Path("light"), "light", name, "made up", "none", *noise, found, digest), gripper, [])
