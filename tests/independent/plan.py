"""What is grasped and how: base parameters of a set and its lists of commands."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .scene import OPEN_M, SAMPLE_S, Servo


@dataclass(frozen=True)
class Thing:
    """An object to grasp."""

    name: str
    radius: float
    rho: float
    f_alpha: float


@dataclass(frozen=True)
class Setup:
    """A set before it is recorded: everything but the effects."""

    servo: Servo
    things: list[Thing]
    thing: np.ndarray  # index of each grasp's object
    offset: np.ndarray  # of each grasp's object, metres
    session: np.ndarray  # 1, 2, … of each grasp
    commands: np.ndarray  # (grasps, samples, 2), metres

    def per_grasp(self, field: str) -> np.ndarray:
        return np.array([getattr(self.things[i], field) for i in self.thing])


def draw_setup(seed: int, grasps: int, plan: str, samples: int) -> Setup:
    """Draws a set. Effects, contact law and noise do not enter: sets of one seed differ in these only."""
    rng = np.random.default_rng([seed, 1])
    servo = Servo(gain=rng.uniform(85, 120), b2=rng.uniform(-12, -7))
    things = _draw_things(rng)
    index = np.arange(grasps)
    thing = (index + index // len(STYLES)) % len(things)
    radius = np.array([things[i].radius for i in thing])
    room = np.minimum(0.006, OPEN_M - 0.003 - radius)  # the open hand must clear the object
    off_centre = rng.permutation(grasps) < round(0.4 * grasps)
    offset = np.where(off_centre, rng.choice([-1, 1], grasps) * rng.uniform(0.25, 1.0, grasps) * room, 0.0)
    commands = np.stack([_commands(rng, plan, i, radius[i], samples) for i in range(grasps)])
    return Setup(servo, things, thing, np.round(offset, 5), 1 + index * 3 // grasps, commands)


def _draw_things(rng: np.random.Generator) -> list[Thing]:
    count = int(rng.integers(3, 7))
    rank = (rng.permutation(count) + rng.uniform(0, 1, count)) / count  # spread over the whole range of stiffness
    f_alpha = 5.0 - 4.5 * rank
    kappa = rank + rng.normal(0, 0.15, count) if rng.random() < 0.5 else rng.uniform(0, 1, count)
    rho = 0.003 + 0.007 * np.clip(kappa, 0, 1)
    radius = np.round(rng.uniform(0.018, 0.033, count), 4)
    return [Thing(f"thing_{i}", *map(float, values)) for i, values in enumerate(zip(radius, rho, f_alpha, strict=True))]


# A move is (target, speed in m/s, pause in s). The target is the command's squeeze in metres beyond the position at
# which a centred object is felt; below 0 the pads are clear of it, and None is a fully open hand.
Move = tuple[float | None, float, float]
_JUMP = 1e9
# So deep inside the outline an object is felt: before that, soft contacts press next to nothing.
_FELT_M = 0.0003


def _slow_ramp(rng: np.random.Generator) -> Iterator[Move]:
    yield -0.003, 0.03, 0.2
    yield rng.uniform(0.002, 0.004), rng.uniform(0.0015, 0.004), 0.6
    yield -0.002, rng.uniform(0.003, 0.006), 0.2


def _fast_steps(rng: np.random.Generator) -> Iterator[Move]:
    yield -rng.uniform(0.003, 0.006), _JUMP, 0.7
    yield rng.uniform(0.001, 0.002), _JUMP, 1.0
    yield -0.004, _JUMP, 0.6
    yield rng.uniform(0.002, 0.003), _JUMP, 1.2
    yield None, _JUMP, 0.8


def _pauses_and_reversals(rng: np.random.Generator) -> Iterator[Move]:
    yield -0.006, 0.02, 0.3
    yield -0.009, 0.01, 0.2
    yield -0.002, 0.01, 0.2
    for low, high in ((0.0005, 0.0018), (0.0008, 0.003)):
        yield high, rng.uniform(0.004, 0.01), 0.25
        yield low, rng.uniform(0.004, 0.01), 0.25
    yield 0.002, 0.008, 0.3


def _partial_releases(rng: np.random.Generator) -> Iterator[Move]:
    yield rng.uniform(0.0022, 0.003), rng.uniform(0.015, 0.03), 0.4
    for _ in range(3):
        yield rng.uniform(0.0003, 0.001), rng.uniform(0.003, 0.02), 0.3
        yield rng.uniform(0.0015, 0.003), rng.uniform(0.003, 0.02), 0.3


def _full_releases(rng: np.random.Generator) -> Iterator[Move]:
    for _ in range(3):
        yield rng.uniform(0.001, 0.003), rng.uniform(0.01, 0.04), 0.35
        yield -rng.uniform(0.001, 0.003), rng.uniform(0.005, 0.03), 0.25


def _long_hold(rng: np.random.Generator) -> Iterator[Move]:
    yield rng.uniform(0.0015, 0.005), rng.choice([0.02, 0.06, _JUMP]), 3.4
    yield -0.003, 0.02, 0.3


def _staircase(rng: np.random.Generator) -> Iterator[Move]:
    yield -0.001, 0.025, 0.2
    rise = rng.uniform(0.0002, 0.0005)
    for i in range(1, 8):
        yield -0.001 + 2 * i * rise, _JUMP, 0.2
    for i in range(6, 0, -2):
        yield -0.001 + 2 * i * rise, _JUMP, 0.3


def _wander(rng: np.random.Generator) -> Iterator[Move]:
    for _ in range(9):
        yield rng.uniform(-0.003, 0.0035), 10 ** rng.uniform(-2.6, -1.1), rng.uniform(0.1, 0.5)


STYLES = (
    _slow_ramp, _fast_steps, _pauses_and_reversals, _partial_releases, _full_releases, _long_hold, _staircase, _wander
)  # fmt: skip


def _close_and_hold(rng: np.random.Generator) -> Iterator[Move]:
    yield rng.uniform(0.0005, 0.003), rng.choice([0.015, 0.02, 0.025]), 6.0


def _commands(rng: np.random.Generator, plan: str, index: int, radius: float, samples: int) -> np.ndarray:
    """One grasp's commands, ``(samples, 2)``: both fingers alike, but for a few where one finger comes later."""
    styles = {"rich": STYLES, "close_and_hold": (_close_and_hold,)}
    if plan not in styles:
        raise ValueError(f"no plan {plan!r}: choose one of {sorted(styles)}")
    moves = styles[plan][index % len(styles[plan])](rng)
    path = [OPEN_M] * int(rng.integers(3, 9))
    for squeeze, speed, pause in moves:
        target = OPEN_M if squeeze is None else radius - _FELT_M - squeeze
        way = target - path[-1]
        steps = max(1, int(np.ceil(abs(way) / (speed * SAMPLE_S))))
        path += [*(path[-1] + way * np.arange(1, steps + 1) / steps), *[target] * round(pause / SAMPLE_S)]
    path = np.array(path + [path[-1]] * samples)[:samples]
    both = np.repeat(np.clip(np.round(path, 6), 0.0, OPEN_M)[:, None], 2, axis=1)
    if plan == "rich" and rng.random() < 0.2:
        late, finger = int(rng.integers(2, 7)), int(rng.integers(2))
        both[late:, finger] = both[:-late, finger].copy()
        both[:late, finger] = OPEN_M
    return both
