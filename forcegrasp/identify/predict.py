"""What a model says the measured grasps should have looked like."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field

import numpy as np

from forcegrasp.effects import Effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.physics.gripper import EFFORT_SCALE, FORCE_SKEW, OF_READINGS, SKEW
from forcegrasp.replay.replay import EffectOn, Motion, Replay, join
from forcegrasp.short_repr import ShortRepr


@dataclass(frozen=True, repr=False)
class Case(ShortRepr):
    """A whole model of a set: base parameters of each grasp, and effects."""

    base: dict[str, np.ndarray]  #: name → ``(G,)``
    effects: tuple[EffectSetting, ...] = field(default=())  #: each with the same values on all grasps

    def moved(self, by: Mapping[str, float]) -> Case:
        """The same with base parameters that are larger by so much, by name."""
        return Case(self.base | {name: self.base[name] + step for name, step in by.items()}, self.effects)

    def simulation_key(self) -> bytes:
        """Equal for cases that differ in nothing but sensors: they share one simulation."""
        parts = [value.tobytes() for name, value in sorted(self.base.items()) if name not in OF_READINGS]
        for one in self.effects:
            if not one.effect.reads_only(one.variant):
                parts.append(f"{one.effect.name}/{one.variant}/".encode() + one.values.tobytes())
        return b"|".join(parts)


#: Takes what is to be predicted in this thread, as :func:`predict_each` does; see :mod:`.side_by_side`.
TAKEN_BY: ContextVar[Callable[[Replay, Sequence[Sequence[Case]]], Sequence[np.ndarray]] | None] = ContextVar(
    "TAKEN_BY", default=None
)


def predict(replay: Replay, cases: Sequence[Case]) -> np.ndarray:
    """Predicted signals of all cases, ``(cases, G, S, C)``; everything that must be simulated is simulated at once.

    The replay remembers how the first case of each call moved: the next call often asks for that one again.
    """
    return predict_each(replay, [cases])[0]


def predict_each(replay: Replay, calls: Sequence[Sequence[Case]]) -> Sequence[np.ndarray]:
    """What :func:`predict` returns for each of some calls, all of which are simulated at once."""
    if (taken_by := TAKEN_BY.get()) is not None:
        return taken_by(replay, calls)
    cases = [case for call in calls for case in call]
    keys, count = [case.simulation_key() for case in cases], len(replay.grasps)
    first = dict(zip(reversed(keys), reversed(cases), strict=True))  # of cases that share a simulation
    known = [key for key in first if key in replay.remembered]
    fresh = [key for key in first if key not in replay.remembered]
    motions = [replay.remembered[key] for key in known]
    if fresh:
        motions.append(_simulate(replay, [first[key] for key in fresh]))
    motion = join(motions)
    place = {key: np.arange(count) + n * count for n, key in enumerate([*known, *fresh])}
    ends = np.cumsum([len(call) for call in calls])
    for start in ends - [len(call) for call in calls]:
        replay.remember(keys[start], motion, place[keys[start]])
    rows = np.concatenate([place[key] for key in keys])
    of_force = EFFORT_SCALE if EFFORT_SCALE in cases[0].base else "force_scale"
    scale = np.concatenate([case.base[of_force] for case in cases])
    skew, force_skew = (
        np.concatenate([case.base[name] for case in cases]) if name in cases[0].base else None
        for name in (SKEW, FORCE_SKEW)
    )
    readings = replay.read(motion, rows, scale, _spread(cases, count, lambda e: e.effect.reads()), skew, force_skew)
    signals = np.concatenate([readings.position, readings.force], axis=-1)
    return np.split(signals.reshape(len(cases), count, *signals.shape[1:]), ends[:-1])


def _simulate(replay: Replay, cases: Sequence[Case]) -> Motion:
    """All grasps of one case after those of the other."""
    count = len(replay.grasps)
    base = {name: np.concatenate([c.base[name] for c in cases]) for name in cases[0].base if name not in OF_READINGS}
    effects = _spread(cases, count, lambda e: not e.effect.reads_only(e.variant))
    return replay.simulate(np.tile(np.arange(count), len(cases)), base, effects)


def _spread(cases: Sequence[Case], count: int, acts: Callable[[EffectSetting], bool]) -> list[EffectOn]:
    """Effects of all cases, each kind once, on the rows of the cases that have it, as far as it acts here."""
    kinds: dict[tuple[type[Effect], str], list[tuple[int, np.ndarray]]] = {}
    for index, case in enumerate(cases):
        for one in case.effects:
            if acts(one):
                kinds.setdefault(one.kind, []).append((index, one.values))
    spread = []
    for (effect, variant), places in kinds.items():
        rows = np.concatenate([np.arange(count) + index * count for index, _ in places])
        spread.append(EffectOn(effect, variant, np.repeat([values for _, values in places], count, axis=0), rows))
    return spread
