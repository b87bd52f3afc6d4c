"""Records grasps of a simulated TIAGo hand, with physical effects hidden in it, as a measurement set.

By hand: ``python -m tests.independent.rig OUT coulomb_friction=medium --seed 1``
"""

from __future__ import annotations

import argparse
import csv
import json
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, fields, replace
from functools import partial, reduce
from pathlib import Path

import numpy as np
import yaml

from .catalogue import CATALOGUE, OTHERWISE, OUTSIDE, VARIANTS, build_effects
from .effect import Effect, State
from .noises import NOISES
from .penalty import PenaltyPlant
from .plan import Setup, draw_setup
from .scene import SAMPLE_S, STEP_S, MujocoPlant, Servo
from .spoiled import SPOILED, Sheet, spoil

__all__ = [
    "CATALOGUE", "OTHERWISE", "OUTSIDE", "VARIANTS", "Recording", "Truth", "draw_setup", "record", "record_one_more",
    "simulate",
]  # fmt: skip

POSITION_STD_M, FORCE_STD_N = 2.7e-5, 0.013

PLANTS: dict[str, Callable] = {
    "mujoco": MujocoPlant,
    "mujoco_multiccd": partial(MujocoPlant, multiccd=True),
    "mujoco_rubbing": MujocoPlant,
    "mujoco_light": partial(MujocoPlant, mass=0.15),
    "mujoco_damped": partial(MujocoPlant, solref="0.01 1"),
    "mujoco_ringing": partial(MujocoPlant, solref="0.02 0.4"),
    "mujoco_firm": partial(MujocoPlant, least=0.5),
    "penalty": PenaltyPlant,
    "hertz": partial(PenaltyPlant, power=1.5),
}
_FRICTION = {"mujoco_rubbing": 4.0}
_COLUMNS = ["grasp", "t_s", "qdes_l_m", "qdes_r_m", "q_l_m", "q_r_m", "f_l_n", "f_r_n"]


@dataclass(frozen=True)
class Recording:
    """What was read, ``(grasps, samples, 2)``; the object's place ``(grasps, samples)``, which no robot knows."""

    q: np.ndarray
    f: np.ndarray
    o: np.ndarray


@dataclass(frozen=True)
class Truth:
    """What is hidden in a set."""

    seed: int
    plan: str
    contact: str
    position_gain: float
    b2: float
    objects: dict[str, dict[str, float]]  # name → radius, rho, f_alpha
    grasps: list[dict]  # object, offset and session of each
    effects: dict[str, dict[str, float]]  # name → the rig's own parameters
    position_std_m: float  # of white noise
    force_std_n: float
    noise: str
    spoiled: str


def record(
    folder: str | Path,
    effects: dict[str, str | dict] | None = None,
    seed: int = 0,
    grasps: int = 24,
    plan: str = "rich",
    contact: str = "mujoco",
    noise: str = "white",
    samples: int = 150,
    jitter_s: float = 0.0,
    spoiled: str = "",
) -> Truth:
    """Writes a measurement set to ``folder``, and beside it, as ``<folder>.truth.json``, what is hidden in it.

    Args:
      effects: name → "small", "medium" or "large", or the effect's own parameters.
      seed: of the base parameters, plan and noise; sets of one seed differ in their effects only.
      plan: "rich" or "close_and_hold".
      contact: one of :data:`PLANTS`; all but the first are another contact law than the model's.
      noise: one of :data:`NOISES`; the set states the standard deviations of white noise.
      jitter_s: samples are taken up to so much earlier or later than their time stamps say.
      spoiled: what is wrong with the set, see :func:`.spoil`.
    """
    folder = Path(folder)
    setup = draw_setup(seed, grasps, plan, samples)
    hidden = build_effects(effects or {})
    recording = simulate(setup, hidden, seed, contact, noise, jitter_s)
    _write(folder, spoil(_sheet(setup, recording), spoiled, np.random.default_rng([seed, 4])))
    placed = zip(setup.thing, setup.offset, setup.session, strict=True)
    truth = Truth(
        seed, plan, contact, setup.servo.gain, setup.servo.b2,
        {t.name: {"radius_m": t.radius, "rho_m": t.rho, "f_alpha": t.f_alpha} for t in setup.things},
        [{"object": setup.things[i].name, "offset_m": float(o), "session": int(day)} for i, o, day in placed],
        {name: _parameters(effect) for name, effect in hidden.items()},
        POSITION_STD_M, FORCE_STD_N, noise, spoiled,
    )  # fmt: skip
    folder.with_name(folder.name + ".truth.json").write_text(json.dumps(asdict(truth), indent=1))
    return truth


def left_by_jitter(
    effects: dict[str, str | dict] | None, seed: int, jitter_s: float, grasps: int = 24, plan: str = "rich",
    contact: str = "mujoco",
) -> float:  # fmt: skip
    """rms of what readings off their time stamps differ by, ÷ noise: no model of such a set foretells it.

    Args:
      effects, seed, jitter_s, grasps, plan, contact: of the set, as for :func:`record`.
    """
    setup = draw_setup(seed, grasps, plan, 150)
    late, said = (simulate(setup, build_effects(effects or {}), seed, contact, jitter_s=by) for by in (jitter_s, 0.0))
    kinds = ((late.q - said.q) / POSITION_STD_M, (late.f - said.f) / FORCE_STD_N)
    return float(np.sqrt(np.mean([np.mean(kind**2) for kind in kinds])))


def record_one_more(
    folder: str | Path, truth: Truth, thing: str, offset: float, commands: np.ndarray, noise_seed: int
) -> None:
    """Writes a set of one more grasp by the hand that recorded a set.

    Args:
      truth: of that set; only white noise, and time stamps without jitter.
      thing: name of the object.
      offset: where it stands, metres.
      commands: ``(samples, 2)``, metres.
      noise_seed: of the readings' noise; another one than the set's.
    """
    setup = draw_setup(truth.seed, len(truth.grasps), truth.plan, len(commands))
    index = [t.name for t in setup.things].index(thing)
    places = {"thing": np.array([index]), "offset": np.array([offset]), "session": np.array([1])}
    setup = replace(setup, **places, commands=np.asarray(commands)[None])
    recording = simulate(setup, build_effects(dict(truth.effects)), noise_seed, truth.contact)
    _write(Path(folder), _sheet(setup, recording))


def _sheet(setup: Setup, recording: Recording) -> Sheet:
    return Sheet(
        SAMPLE_S, [setup.things[i].name for i in setup.thing], setup.session, setup.per_grasp("radius"), setup.offset,
        setup.commands, recording.q, recording.f,
    )  # fmt: skip


def simulate(
    setup: Setup,
    effects: dict[str, Effect],
    seed: int = 0,
    contact: str = "mujoco",
    noise: str = "white",
    jitter_s: float = 0.0,
) -> Recording:
    """Runs all grasps of a set side by side."""
    n, samples = setup.commands.shape[:2]
    rng = np.random.default_rng([seed, 2])
    noise_q, noise_f = NOISES[noise](rng, (2, n, samples, 2)) * [[[[POSITION_STD_M]]], [[[FORCE_STD_N]]]]
    late_s = np.random.default_rng([seed, 5]).uniform(-jitter_s, jitter_s, samples + 1)
    ends = np.round((SAMPLE_S * np.arange(samples + 1) + late_s) / STEP_S).astype(int)
    for i, effect in enumerate(effects.values()):
        effect.start(n, np.random.default_rng([seed, 3, i]))
    hooks = _Hooks(effects.values())
    servo = hooks.chain("servo")(setup.servo)
    hand = _Hand(setup, servo, contact, hooks, [e for e in effects.values() if e.drivetrain])
    sense, encode, digitise = hooks.chain("force"), hooks.chain("position"), hooks.all("digitise")
    send, drive = hooks.chain("send"), hooks.chain("setpoint")

    s, q, f, o = hand.state, [], [], []
    force = sense(s.f, s)
    for k in range(samples):
        reading = encode(s.q, s) + noise_q[:, k], force + noise_f[:, k]
        for store in digitise:
            reading = store(*reading)
        q.append(reading[0])
        f.append(reading[1])
        o.append(s.o)
        sent = send(setup.commands[:, k], reading[0])
        for _ in range(ends[k + 1] - ends[k]):
            s.setpoint = drive(sent, s)
            hand.step()
            force = sense(s.f, s)
    hand.plant.check()
    return Recording(np.stack(q, 1), np.stack(f, 1), np.stack(o, 1))


class _Hooks:
    """The hooks that effects override, so that the others cost nothing."""

    def __init__(self, effects: Iterable[Effect]) -> None:
        self._effects = list(effects)

    def all(self, hook: str) -> list[Callable]:
        return [getattr(e, hook) for e in self._effects if getattr(type(e), hook) is not getattr(Effect, hook)]

    def chain(self, hook: str) -> Callable:
        """One effect's result is the next one's input."""
        steps = self.all(hook)
        return lambda value, *rest: reduce(lambda v, step: step(v, *rest), steps, value)

    def total(self, hook: str, zero: np.ndarray) -> Callable:
        """Forces add up."""
        steps = self.all(hook)
        return lambda s: sum((step(s) for step in steps), zero)


class _Hand:
    """The plant, the forces that effects add to it, and the motors where they are not part of it."""

    def __init__(self, setup: Setup, servo: Servo, contact: str, hooks: _Hooks, drivetrains: list) -> None:
        if len(drivetrains) > 1:
            raise ValueError("one effect between motor and pad at a time")
        n = len(setup.commands)
        self._drivetrain = drivetrains[0] if drivetrains else None
        self._radius, self._gain = setup.per_grasp("radius")[:, None], setup.per_grasp("f_alpha")[:, None]
        rho = setup.per_grasp("rho")
        friction = hooks.chain("mu")(_FRICTION.get(contact, 1.0))
        motors = None if self._drivetrain else servo
        self.plant = PLANTS[contact](rho, self._radius[:, 0], setup.offset, motors, friction=friction)
        nothing = np.zeros((n, 2))
        self._motor, self._press = hooks.total("motor", nothing), hooks.total("press", nothing)
        self._table = hooks.total("table", np.zeros(n))
        p = self.plant
        self.state = State(servo, p.q, p.v, p.o, p.ov, nothing, nothing, setup.commands[:, 0], nothing)
        self._look()

    def step(self) -> None:
        s, plant = self.state, self.plant
        motor, press, table = self._motor(s), self._press(s), self._table(s)
        if self._drivetrain is None:
            plant.step(s.setpoint, motor, press, table)
            s.q, s.v = plant.q, plant.v
        else:
            on_pad, on_motor = self._drivetrain.couple(s, plant.q, plant.v, plant.load)
            plant.step(s.setpoint, on_pad, press, table)
            drag = self._drivetrain.guide_on_motor * s.v
            s.v = s.v + STEP_S * (s.motor_force() + motor + on_motor - drag) / self._drivetrain.motor_kg
            s.q = s.q + STEP_S * s.v
        s.time += STEP_S
        self._look()

    def _look(self) -> None:
        s, plant = self.state, self.plant
        s.o, s.ov, s.f, s.load = plant.o, plant.ov, plant.touch * self._gain, plant.load
        # The left finger meets the object's lower side along y, the right one its upper side.
        s.depth = self._radius - plant.q - s.o[:, None] * [1.0, -1.0]


def _parameters(effect: Effect) -> dict[str, float]:
    return {f.name: float(getattr(effect, f.name)) for f in fields(effect) if f.init}


def _write(folder: Path, sheet: Sheet) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    meta = {
        "format": "forcegrasp-measurements/1", "kind": "grasps", "gripper": "tiago",
        "source": "independent simulated rig", "license": "CC0-1.0",
        "position_std_m": POSITION_STD_M, "force_std_n": FORCE_STD_N,
    }  # fmt: skip
    (folder / "meta.yaml").write_text(yaml.safe_dump(meta, sort_keys=False))
    with (folder / "grasps.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["grasp", "object", "session", "object_radius_m", "object_offset_m"])
        columns = zip(sheet.label, sheet.session, sheet.radius, sheet.offset, strict=True)
        for grasp, (label, day, radius, offset) in enumerate(columns):
            rows.writerow([grasp, label, f"session_{day}", round(float(radius), 6), float(offset)])
    with (folder / "samples.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(_COLUMNS)
        values = np.concatenate([sheet.commands, sheet.q, sheet.f], axis=2)
        for grasp, series in enumerate(values):
            for k, row in enumerate(series):
                rows.writerow([grasp, f"{k * sheet.period_s:.2f}", *(f"{x:.9g}" for x in row)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("effects", nargs="*", help="effect=size, or effect=parameter:value,parameter:value")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--grasps", type=int, default=24)
    parser.add_argument("--samples", type=int, default=150)
    parser.add_argument("--plan", default="rich", choices=["rich", "close_and_hold"])
    parser.add_argument("--contact", default="mujoco", choices=sorted(PLANTS))
    parser.add_argument("--noise", default="white", choices=sorted(NOISES))
    parser.add_argument("--spoiled", default="", choices=sorted(SPOILED))
    args = parser.parse_args()
    chosen: dict[str, str | dict] = {}
    for item in args.effects:
        name, _, value = item.partition("=")
        pairs = [pair.split(":") for pair in value.split(",")]
        chosen[name] = {key: float(x) for key, x in pairs} if ":" in value else value
    truth = record(
        args.folder, chosen, args.seed, args.grasps, args.plan, args.contact, args.noise, args.samples,
        spoiled=args.spoiled,
    )  # fmt: skip
    print(json.dumps(asdict(truth), indent=1))


if __name__ == "__main__":
    main()
