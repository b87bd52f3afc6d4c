"""Makes a measurement set from the simulator: planned grasps, sensor noise, and effects if any are asked for."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.errors import ConfigError, closest
from forcegrasp.measure.schema import (
    RADIUS_STD_M,
    MeasuredGrasp,
    MeasurementSet,
    columns_of,
    fingerprint_of_set,
)
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import default_gripper
from forcegrasp.physics.gripper_parts import BaseParameter
from forcegrasp.physics.sensors import rounding_steps, with_noise
from forcegrasp.replay.next_grasp import NextGrasp
from forcegrasp.replay.plans import PERIOD_S, SAMPLES, PlannedGrasp, make_plan
from forcegrasp.replay.replay import EffectOn, Replay
from forcegrasp.short_repr import ShortRepr

# Objects' radii, as shares of half the opening: both fingers reach them, and they fit in.
_RADII = (0.4, 0.75)
# The next grasp's object is the one that was drawn if radii differ by so many standard deviations at most.
_SAME_RADIUS = 3.0
# Objects differ from the nominal one by up to this factor, either way.
_OBJECT_FACTOR = 2.0


@dataclasses.dataclass(frozen=True, repr=False)
class Recorded(ShortRepr):
    """A set, and the truth that its files don't tell."""

    measured: MeasurementSet
    base: dict[str, np.ndarray]  #: true base parameters of each grasp, ``(G,)``


def record(
    gripper: Gripper,
    plan: str,
    *,
    grasps: int,
    objects: int,
    effects: Sequence[EffectSetting],
    known: dict[str, float],
    off_nominal: float,
    position_std_m: float,
    force_std_n: float,
    seed: int,
    next_grasp: NextGrasp | None = None,
) -> Recorded:
    """Simulates a measurement set.

    Args:
      gripper: what is simulated.
      plan: a name out of :data:`~forcegrasp.replay.plans.PLANS`.
      grasps: how many.
      objects: number of objects that are grasped in turn; their parameters are drawn.
      effects: those that act.
      known: base parameters of the gripper that are not drawn.
      off_nominal: largest share by which the other ones differ from nominal.
      position_std_m: noise of the positions, m or rad.
      force_std_n: noise of the forces.
      seed: of everything random.
      next_grasp: recorded in place of the plan, with other noise, on the object that the rest draws.

    Raises:
      ConfigError: if the next grasp's object is not one of those drawn.
    """
    rng = np.random.default_rng(seed)
    parameters = gripper.parameters.values()
    of_gripper = {
        p.name: known.get(p.name, _clip(p, p.nominal * (1 + off_nominal * rng.uniform(-1, 1))))
        for p in parameters
        if p.scope == "gripper"
    }
    of_objects = {p.name: _draw(p, objects, rng) for p in parameters if p.scope == "object" and p.name != "radius_m"}
    radii = rng.uniform(*_RADII, objects) * (gripper.opening.opening_m[-1] / 2)
    if next_grasp is None:
        planned = make_plan(plan, radii, grasps, gripper, rng)
    else:
        planned, grasps = [_planned(next_grasp, radii, gripper)], 1
        plan, rng = f"next grasp ({next_grasp.grasp})", np.random.default_rng((seed, 1))
    object_index = np.array([p.object for p in planned])
    base = {name: np.full(grasps, value) for name, value in of_gripper.items()}
    base |= {name: values[object_index] for name, values in of_objects.items()}
    base |= {"radius_m": radii[object_index], "offset_m": np.array([p.offset_m for p in planned])}
    time, rest = np.arange(SAMPLES) * PERIOD_S, np.full((SAMPLES, len(gripper.motors)), gripper.stroke)
    unloaded = np.zeros((SAMPLES, len(gripper.forces)))
    bare = [
        MeasuredGrasp(
            f"g{index:03}", f"object_{p.object + 1}", "simulated", float(radii[p.object]), p.offset_m, None,
            time, p.command_m, rest, unloaded, None, columns=columns_of(gripper),
        )
        for index, p in enumerate(planned)
    ]  # fmt: skip
    rows = np.arange(grasps)
    replay = Replay(gripper, bare, encoders_known=False, strict=True)
    on = [EffectOn(*one.kind, np.repeat(one.values[None], grasps, axis=0), rows) for one in effects]
    steps = rounding_steps((one.effect, one.values) for one in effects)
    of_position, of_force = (rng.standard_normal((grasps, *values.shape)) for values in (rest, unloaded))

    def logged(position: np.ndarray, grasp: np.ndarray, sample: np.ndarray) -> np.ndarray:
        """Positions as the log has them, which a driver acts on: `replay` takes the log's for its driver's, too."""
        return with_noise(position, position_std_m, of_position[grasp, sample], steps[0])

    motion = replay.simulate(
        rows,
        {n: v for n, v in base.items() if n != "force_scale"},
        [e for e in on if not e.effect.reads_only(e.variant)],
        logged,
    )
    readings = replay.read(motion, rows, base["force_scale"], [e for e in on if e.effect.reads()])
    position = logged(readings.position, rows[:, None], np.arange(SAMPLES))
    force = with_noise(readings.force, force_std_n, of_force, steps[1])
    full = tuple(dataclasses.replace(g, position_m=position[i], force_n=force[i]) for i, g in enumerate(bare))
    name = gripper.name_or_path
    noise = (position_std_m or None, force_std_n or None)  # a set without noise does not give any
    fingerprint = fingerprint_of_set(name, *noise, full)
    source = f"simulated by forcegrasp record, plan {plan}, seed {seed}"
    measured = MeasurementSet(Path(), "recorded", name, source, "none: simulated", *noise, full, fingerprint)
    return Recorded(measured, base)


def _planned(proposed: NextGrasp, radii_m: np.ndarray, gripper: Gripper) -> PlannedGrasp:
    """The proposed grasp of one of the objects that were drawn."""
    names = [f"object_{index + 1}" for index in range(len(radii_m))]
    place = f"next: is a grasp of {proposed.object!r}"
    if proposed.object not in names:
        raise ConfigError(
            f"{place}, here are {names[0]} to {names[-1]}; give the options that the set was recorded with"
        )
    index = names.index(proposed.object)
    if abs(radii_m[index] - proposed.radius_m) > _SAME_RADIUS * RADIUS_STD_M:
        radii = f"{1e3 * proposed.radius_m:.4g} mm, here it has {1e3 * radii_m[index]:.4g} mm"
        raise ConfigError(f"{place} with a radius of {radii}; give objects, seed and all else as for the set")
    return PlannedGrasp(index, proposed.grasp, proposed.offset_m, proposed.command(gripper))


def parse_effect(text: str, gripper: Gripper | None = None) -> EffectSetting:
    """Reads ``NAME [VARIANT] [PARAMETER=VALUE ...]``; what is not given is typical of the gripper (the paper's).

    Raises:
      ConfigError: if the gripper has no such effect, variant or parameter, or a value is out of bounds.
    """
    name, *words = text.split() or [""]
    typical = EffectSetting.typical(effect_of(name, gripper or default_gripper()))
    (effect, variant), values = typical.kind, typical.parameters
    bounds = {p.name: p for p in effect.parameters}
    for word in words:
        key, equals, number = word.partition("=")
        if not equals and key in effect.variants:
            variant = key
        elif not equals or key not in bounds:
            raise ConfigError(
                f"effects: {name} has no {key!r}{closest(key, [*bounds, *filter(None, effect.variants)])}"
            )
        else:
            values[key] = _number(name, bounds[key], number)
    return EffectSetting(effect, variant, np.array(list(values.values())))


def _number(name: str, parameter, text: str) -> float:
    try:
        value = float(text)
    except ValueError as error:
        raise ConfigError(f"effects: {name} {parameter.name}={text}: must be a number in {parameter.unit}") from error
    if not (parameter.low <= value <= parameter.high or value == parameter.null):
        limits = f"[{parameter.low:g}, {parameter.high:g}]"
        raise ConfigError(f"effects: {name} {parameter.name}={text}: must lie in {limits} {parameter.unit}")
    return value


def _draw(parameter: BaseParameter, count: int, rng: np.random.Generator) -> np.ndarray:
    factor = _OBJECT_FACTOR ** rng.uniform(-1, 1, count)
    return np.array([_clip(parameter, parameter.nominal * f) for f in factor])


def _clip(parameter: BaseParameter, value: float) -> float:
    return float(np.clip(value, parameter.low, parameter.high))
