"""A starter set: a simulated jaw with dry friction, read by its encoder's counts."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet, columns_of, fingerprint_of_set
from forcegrasp.physics.gripper import SKEW
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.replay.replay import EffectOn, Replay

#: What is hidden in it: N·m of friction. And an encoder's count, rad.
FRICTION_NM, COUNT_RAD = 0.08, 2 * np.pi / 4096
_PERIOD_S, _SECONDS, _SEED = 0.02, 8.0, 1


def example_set() -> MeasurementSet:
    """Six recordings of the shipped jaw: steps, ramps and sines."""
    mechanism, rng = load_gripper("so101_jaw"), np.random.default_rng(_SEED)
    time = np.arange(0, _SECONDS, _PERIOD_S)
    recordings = []
    for name, command in _commands(time).items():
        blank = np.full((len(time), 1), command[0])
        recordings.append(
            MeasuredGrasp(
                name=name, object="", session=name, radius_m=None, offset_m=None, split=None, time_s=time,
                command_m=command[:, None], position_m=blank, force_n=np.empty((len(time), 0)), object_m=None,
                columns=columns_of(mechanism), start=(blank[0], np.zeros(1)),
            )
        )  # fmt: skip
    replay, rows = Replay(mechanism, recordings, encoders_known=False, strict=True), np.arange(len(recordings))
    friction = effect_of("coulomb_friction", mechanism)
    hidden = EffectOn(friction, "", np.full((len(rows), 1), FRICTION_NM), rows)
    base = {name: np.full(len(rows), p.nominal) for name, p in mechanism.parameters.items()}
    motion = replay.simulate(rows, base, [hidden])
    read = replay.read(motion, rows, np.ones(len(rows)), skew_s=base[SKEW]).position
    noisy = read + 0.3 * COUNT_RAD * rng.standard_normal(read.shape)
    found = tuple(
        dataclasses.replace(one, position_m=np.round(noisy[i] / COUNT_RAD) * COUNT_RAD, start=None)
        for i, one in enumerate(recordings)
    )
    return MeasurementSet(
        path=Path("example"), name="example", gripper="so101_jaw", source="simulated by forcegrasp import example=true",
        license="", position_std_m=None, force_std_n=None, grasps=found,
        fingerprint=fingerprint_of_set("so101_jaw", None, None, found), kind="servo",
    )  # fmt: skip


def _commands(time: np.ndarray) -> dict[str, np.ndarray]:
    """Commanded positions by name, rad, each of the length of ``time``."""
    triangle = np.abs((time / 2) % 2 - 1)
    return {
        "steps": 0.5 + 0.25 * np.sign(np.sin(2 * np.pi * time / 3)),
        "small_steps": 0.5 + 0.03 * np.floor(4 * triangle),
        "ramp": 0.3 + 0.5 * triangle,
        "slow_sine": 0.5 + 0.2 * np.sin(2 * np.pi * time / 6),
        "sine": 0.5 + 0.2 * np.sin(2 * np.pi * time / 2),
        "small_sine": 0.5 + 0.03 * np.sin(2 * np.pi * time / 3),
    }
