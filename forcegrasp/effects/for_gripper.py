"""The catalogue as one gripper needs it: as many motors and force channels, its units, its sizes."""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass

import numpy as np

from forcegrasp.effects.base import Effect, Parameter
from forcegrasp.effects.none import NoEffect
from forcegrasp.effects.registry import catalogue
from forcegrasp.errors import ConfigError, closest
from forcegrasp.physics.gripper import Gripper


@dataclass(frozen=True)
class _Traits:
    """What of a gripper an effect depends on."""

    motors: int
    channels: int
    grasps: bool  #: it has fingers
    turns: bool  #: its motors turn instead of sliding
    position: float  #: factors of sizes, see :class:`~forcegrasp.physics.gripper.Gripper`
    effort: float
    force: float

    @classmethod
    def of(cls, gripper: Gripper) -> _Traits:
        pairs = zip(gripper.opening.travel, gripper.sides, strict=True) if gripper.sides else ()
        travel = [t for t, (_, finger) in pairs if finger.motor == 0]
        turns, force = gripper.unit == "rad", gripper.force_scale
        effort = force * (float(sum(travel)) if travel and not gripper.is_direct else 1.0)
        motors, channels = len(gripper.motors), len(gripper.forces)
        return cls(motors, channels, not gripper.is_servo, turns, gripper.position_scale, effort, force)


def effects_of(gripper: Gripper) -> dict[str, type[Effect]]:
    """Effects that can show on a gripper, by name, in the order in which they act."""
    traits = _Traits.of(gripper)
    return {
        name: _adapt(effect, traits)
        for name, effect in catalogue().items()
        if effect.least_channels <= traits.channels and (traits.grasps or not effect.needs_object)
    }


def effect_of(name: str, gripper: Gripper) -> type[Effect]:
    """An effect as this gripper has it.

    Raises:
      ConfigError: if there is none of that name, or it can't show on this gripper.
    """
    known = effects_of(gripper) | {NoEffect.name: NoEffect}
    if name in known:
        return known[name]
    if name in catalogue() and catalogue()[name].needs_object and gripper.is_servo:
        raise ConfigError(f"effect {name}: is one of grasped objects; {gripper.name} grasps nothing")
    if name in catalogue():
        need = catalogue()[name].least_channels
        raise ConfigError(f"effect {name}: needs {need} force readings; {gripper.name} has {len(gripper.forces)}")
    raise ConfigError(f"effect {name}: no such effect{closest(name, known)}")


@functools.cache
def _adapt(effect: type[Effect], traits: _Traits) -> type[Effect]:
    if traits == _Traits(2, 2, True, False, 1.0, 1.0, 1.0):
        return effect
    count = {"motor": traits.motors, "channel": traits.channels}.get(effect.per, len(effect.parameters))
    factors = np.array([_factor(p, traits) for p in effect.parameters[:count]])
    parameters = tuple(
        _rename(p, float(f), effect, traits, alone=bool(effect.per) and count == 1)
        for p, f in zip(effect.parameters, factors, strict=False)
    )
    tried = effect.trials()[:, :count] * factors if len(effect.trials()) else np.empty((0, count))
    if effect.per:
        tried = tried[tried.any(axis=1)]
    own = [p.name for p in effect.parameters]

    def trials(cls: type[Effect]) -> np.ndarray:
        return tried.copy()

    def index(cls: type[Effect], parameter: str) -> int:
        return own.index(parameter)

    return type(effect.__name__, (effect,), {
        "__doc__": effect.__doc__, "__module__": effect.__module__, "parameters": parameters,
        "motors": traits.motors, "channels": traits.channels, "position_scale": traits.position,
        "trials": classmethod(trials), "index": classmethod(index),
    })  # fmt: skip


def _factor(parameter: Parameter, traits: _Traits) -> float:
    factors = {"position": traits.position, "effort": traits.effort, "force": traits.force, "": 1.0}
    return 1 / traits.force if parameter.follows == "compliance" else factors[parameter.follows]


def _rename(parameter: Parameter, factor: float, effect: type[Effect], traits: _Traits, alone: bool) -> Parameter:
    name, unit = parameter.name, parameter.unit
    if traits.turns and parameter.follows == "position":
        name, unit = name.replace("_m", "_rad"), unit.replace("m", "rad", 1)
    if traits.turns and parameter.follows == "effort":
        name, unit = name.replace("_n", "_nm").replace("force", "torque"), unit.replace("N", "N·m")
    if alone:
        name = name.replace("left", effect.alone)
    doc = parameter.doc.replace("the left ", "the ") if alone else parameter.doc
    sizes = {key: getattr(parameter, key) * factor for key in ("low", "high", "typical")}
    null = parameter.null if parameter.null in (0.0, np.inf) else parameter.null * factor
    trials = tuple(size * factor for size in parameter.trials)
    return dataclasses.replace(parameter, name=name, unit=unit, doc=doc, null=null, trials=trials, **sizes)
