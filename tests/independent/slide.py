"""Records logs of a simulated servo, a slide without fingers or object, with physical effects hidden in it.

By hand: ``python -m tests.independent.slide OUT presliding=medium --seed 1``
"""

from __future__ import annotations

import argparse
import csv
import json
import shutil
from dataclasses import dataclass, fields
from functools import reduce
from pathlib import Path

import numpy as np
import yaml

from .catalogue import CATALOGUE, OUTSIDE, build_effects
from .effect import Effect, State
from .scene import FINGER_KG, GUIDE_DAMPING, ROTOR_KG, STEP_S, Servo

SAMPLE_S, POSITION_STD_M = 0.01, 5e-5
#: Effects that a servo can have, and what the catalogue calls those that have another name here.
EFFECTS = (
    "command_delay", "command_deadband", "rate_limit", "coulomb_friction", "stiction", "load_friction", "presliding",
    "smooth_friction", "direction_friction", "position_deadband", "back_emf", "motor_offset", "actuator_lag",
    "force_limit", "swinging_load", "stale_velocity", "readout_skew", "encoder_bias",
)  # fmt: skip
CALLED = {"swinging_load": "elastic_transmission", "stale_velocity": "velocity_lag"}
_KG = FINGER_KG + ROTOR_KG


@dataclass(frozen=True)
class Log:
    """What was commanded, read and loaded, ``(samples, recordings)``."""

    command: np.ndarray
    position: np.ndarray
    load: np.ndarray


def commands(rng: np.random.Generator, recordings: int, samples: int) -> np.ndarray:
    """Steps of many sizes, ramps of many speeds, waves, and rests, m, ``(samples, recordings)``."""
    paths = []
    for _ in range(recordings):
        path = [0.025]
        while len(path) < samples:
            target, kind = rng.uniform(0.003, 0.047), rng.integers(4)
            if kind == 0:  # a small step
                target = np.clip(path[-1] + rng.choice([-1, 1]) * 10 ** rng.uniform(-3.7, -2.5), 0.002, 0.048)
            if kind == 1:  # a ramp
                way = target - path[-1]
                steps = max(2, int(abs(way) / 10 ** rng.uniform(-2.5, -1.1) / SAMPLE_S))
                path += list(path[-1] + way * np.arange(1, steps + 1) / steps)
            if kind == 2:  # a wave
                count = int(rng.uniform(60, 200))
                turns = np.sin(np.arange(count) * SAMPLE_S * 2 * np.pi * rng.uniform(0.4, 2.5))
                path += list(np.clip(path[-1] + 10 ** rng.uniform(-3.3, -2.2) * turns, 0.0, 0.05))
            path += [target if kind in (0, 3) else path[-1]] * int(rng.uniform(15, 70))
        paths.append(path[:samples])
    return np.round(np.array(paths).T, 6)


def loads(rng: np.random.Generator, recordings: int, samples: int) -> np.ndarray:
    """Forces that are put on every other slide from outside, N; positive opens."""
    out = np.zeros((samples, recordings))
    for column in range(0, recordings, 2):
        for start in range(0, samples, 150):
            out[start + 40 : start + 150, column] = rng.choice([0.0, rng.uniform(-0.4, 0.4)])
    return np.round(out, 4)


def simulate(
    effects: dict[str, Effect], seed: int = 0, recordings: int = 6, samples: int = 800, noise: bool = True
) -> Log:
    """Runs all recordings side by side: two columns a row, which the hand's effects take for its fingers."""
    rng = np.random.default_rng([seed, 1])
    servo = Servo(rng.uniform(80, 130), rng.uniform(-12, -7), np.inf)
    command, load = commands(rng, recordings, samples), loads(rng, recordings, samples)
    noise_q = POSITION_STD_M * noise * np.random.default_rng([seed, 2]).standard_normal((samples, recordings))
    for i, effect in enumerate(effects.values()):
        effect.start(recordings // 2, np.random.default_rng([seed, 3, i]))
        servo = effect.servo(servo)
    now = command[0].reshape(-1, 2)
    nothing = np.zeros_like(now)
    s = State(servo, now.copy(), nothing, nothing, nothing, nothing - 1, nothing, now, nothing)
    read = []
    for k in range(samples):
        s.load = load[k].reshape(-1, 2)
        reading = reduce(lambda q, e: e.position(q, s), effects.values(), s.q) + noise_q[k].reshape(-1, 2)
        reading, _ = reduce(lambda pair, e: e.digitise(*pair), effects.values(), (reading, s.f))
        read.append(reading.ravel())
        sent = reduce(lambda u, e: e.send(u, reading), effects.values(), command[k].reshape(-1, 2))
        for _ in range(round(SAMPLE_S / STEP_S)):
            s.setpoint = reduce(lambda u, e: e.setpoint(u, s), effects.values(), sent)
            push = s.motor_force() + s.load - GUIDE_DAMPING * s.v + sum(e.motor(s) for e in effects.values())
            s.v = s.v + STEP_S * push / _KG
            s.q = s.q + STEP_S * s.v
            s.time += STEP_S
            for effect in effects.values():
                effect.force(s.f, s)
    if not np.all(np.abs(s.q) < 1):
        raise FloatingPointError("the slide diverged")
    return Log(command, np.array(read), load)


def record(folder: str | Path, chosen: dict[str, str | dict] | None = None, seed: int = 0, **size: int) -> dict:
    """Writes a set to ``folder``, the slide's description with it, and what is hidden beside it; returns that."""
    folder = Path(folder)
    hidden = build_effects({
        name: CATALOGUE[name]["medium"] | {"left": 3e-4, "right": 3e-4} if name == "encoder_bias" else value
        for name, value in (chosen or {}).items()
    })  # fmt: skip
    if "motor_offset" in hidden:  # of one motor
        hidden["motor_offset"].right = hidden["motor_offset"].left
    log = simulate(hidden, seed, **size)
    folder.mkdir(parents=True, exist_ok=True)
    for kind in ("xml", "yaml"):
        shutil.copy(Path(__file__).with_name(f"slide.{kind}"), folder)
    meta = {
        "format": "forcegrasp-measurements/1", "kind": "servo", "mechanism": "./slide.yaml",
        "source": "independent simulated slide", "license": "CC0-1.0", "position_std_m": POSITION_STD_M,
    }  # fmt: skip
    (folder / "meta.yaml").write_text(yaml.safe_dump(meta, sort_keys=False))
    with (folder / "recordings.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["recording"], *([f"r{i}"] for i in range(log.command.shape[1]))])
    with (folder / "samples.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["recording", "t_s", "qdes_m", "q_m", "load"])
        for i in range(log.command.shape[1]):
            for k, values in enumerate(zip(log.command[:, i], log.position[:, i], log.load[:, i], strict=True)):
                rows.writerow([f"r{i}", f"{k * SAMPLE_S:.2f}", *(f"{x:.8g}" for x in values)])
    truth = {CALLED.get(n, n): {f.name: getattr(e, f.name) for f in fields(e) if f.init} for n, e in hidden.items()}
    folder.with_name(folder.name + ".truth.json").write_text(json.dumps(truth, indent=1))
    return truth


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("effects", nargs="*", metavar="EFFECT=SIZE", help=f"of {', '.join(EFFECTS)}")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    chosen: dict[str, str | dict] = dict(item.split("=") for item in args.effects)
    unknown = set(chosen) - set(EFFECTS)
    if unknown:
        parser.error(f"a servo has no {', '.join(sorted(unknown & set(CATALOGUE | OUTSIDE)) or sorted(unknown))}")
    print(json.dumps(record(args.folder, chosen, args.seed), indent=1))


if __name__ == "__main__":
    main()
