"""How long a diagnosis of a servo's log takes: python tools/servo_speed.py [--samples 30000] [--rate 1000]

A log of that many samples is simulated, with dry friction that its model lacks, and diagnosed with the whole catalogue.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from pathlib import Path

import numpy as np

from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.identify.loading import Loaded
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet, columns_of, fingerprint_of_set
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.replay.replay import EffectOn, Replay

#: Recordings of a set, and the share of its span by which each moves.
RECORDINGS, SHARE = 6, 0.4


def simulated(mechanism_name: str, samples: int, rate: float, seed: int = 1) -> MeasurementSet:
    """Recordings of steps and sines of rising frequency, with typical dry friction and noise of 1/5000 of the span."""
    mechanism, rng = load_gripper(mechanism_name), np.random.default_rng(seed)
    span, count = mechanism.stroke, samples // RECORDINGS
    instants = np.arange(count) / rate
    found = []
    for index in range(RECORDINGS):
        sweep = np.sin(2 * np.pi * (0.2 + 0.05 * index) * instants * (1 + instants / instants[-1]))
        steps = np.sign(np.sin(2 * np.pi * instants / (2.0 + index)))
        command = SHARE * span * (0.7 * sweep + 0.3 * (steps if index % 2 else 0))
        command[: int(0.5 * rate)] = 0
        found.append(
            MeasuredGrasp(
                name=f"run_{index}", object="", session=f"run_{index}", radius_m=None, offset_m=None, split=None,
                time_s=instants, command_m=command[:, None], position_m=np.zeros((count, 1)),
                force_n=np.zeros((count, len(mechanism.forces))), object_m=None, columns=columns_of(mechanism),
                settings={p.times: 200.0 for p in mechanism.parameters.values() if p.times},
                start=(np.zeros(1), np.zeros(1)),
            )
        )  # fmt: skip
    replay, rows = Replay(mechanism, found, encoders_known=False), np.arange(RECORDINGS)
    effect = effect_of("coulomb_friction", mechanism)
    hidden = EffectOn(effect, "", np.tile(effect.typical_values(), (RECORDINGS, 1)), rows)
    base = {p.name: np.full(RECORDINGS, p.nominal * (200.0 if p.times else 1.0)) for p in mechanism.parameters.values()}
    read = replay.read(replay.simulate(rows, base, [hidden]), rows, np.ones(RECORDINGS))
    position = read.position + span / 5000 * rng.standard_normal(read.position.shape)
    force = read.force + 0.003 * np.abs(read.force).max(initial=0) * rng.standard_normal(read.force.shape)
    done = tuple(
        dataclasses.replace(g, position_m=p, force_n=f, start=None)
        for g, p, f in zip(found, position, force, strict=True)
    )
    return MeasurementSet(
        path=Path(mechanism_name), name=mechanism_name, gripper=mechanism_name, source="simulated", license="",
        position_std_m=None, force_std_n=None, grasps=done,
        fingerprint=fingerprint_of_set(mechanism_name, None, None, done), kind="servo",
    )  # fmt: skip


def main() -> None:
    """Simulates a set, diagnoses it, prints what was found and the seconds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=30_000)
    parser.add_argument("--rate", type=float, default=1000.0, help="samples a second")
    parser.add_argument("--mechanism", default="so101_jaw")
    arguments = parser.parse_args()
    measured = simulated(arguments.mechanism, arguments.samples, arguments.rate)
    wall, processor = time.perf_counter(), time.process_time()
    found, _ = diagnose_set(Loaded(measured, load_gripper(arguments.mechanism), []), None, [], 0, lambda text: None)
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    print(
        f"{arguments.samples} samples at {arguments.rate:g} Hz, {arguments.mechanism}: {found.verdict}"
        f" {', '.join(found.preferred)}; {found.error_before:.1f} to {found.error_after:.2f} × noise;"
        f" {wall:.0f} s, {processor:.0f} s of processor time"
    )


if __name__ == "__main__":
    main()
