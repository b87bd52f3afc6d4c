"""The catalogue as one gripper needs it: as many motors and force channels, its units, its sizes."""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass

import numpy as np

from forcegrasp.effects.base import Effect, Parameter
from forcegrasp.effects.none import NoEffect
from forcegrasp.effects.registry import catalogue, no_such_effect
from forcegrasp.errors import ConfigError
from forcegrasp.physics.gripper import Gripper


@dataclass(frozen=True)
class _Traits:
    """What of a gripper an effect depends on."""

    motors: int
    channels: int
    pads: bool  #: it has fingers
    commands_effort: bool
    turns: bool  #: its motors turn instead of sliding
    position: float  #: factors of sizes, see :class:`~forcegrasp.physics.gripper.Gripper`
    effort: float
    force: float
    own_stiffness: bool = False  #: contacts of each object have a stiffness of their own

    @classmethod
    def of(cls, gripper: Gripper) -> _Traits:
        pairs = zip(gripper.opening.travel, gripper.sides, strict=True) if gripper.sides else ()
        travel = [t for t, (_, finger) in pairs if finger.motor == 0]
        turns, force = gripper.unit == "rad", gripper.force_scale
        effort = force * (float(sum(travel)) if travel and not gripper.is_direct else 1.0)
        motors, channels = len(gripper.motors), len(gripper.forces)
        kind = not gripper.is_servo, gripper.command != "position", turns
        return cls(motors, channels, *kind, gripper.position_scale, effort, force, gripper.has_own_stiffness)


#: Those that the catalogue is written for.
_AS_WRITTEN = _Traits(2, 2, True, False, False, 1.0, 1.0, 1.0)


def effects_of(gripper: Gripper) -> dict[str, type[Effect]]:
    """Effects that can show on a gripper, by name, in the order in which they act."""
    traits = _Traits.of(gripper)
    return {name: _adapt(effect, traits) for name, effect in catalogue().items() if not why_left_out(effect, gripper)}


def why_left_out(effect: type[Effect], gripper: Gripper) -> str:
    """Why an effect can't show on a gripper; empty if it can."""
    if effect.needs_object and gripper.is_servo:
        return f"is one of grasped objects; {gripper.name} grasps nothing"
    if effect.needs_ground and not gripper.has_ground:
        return f"needs ground that an object can rub on; that of {gripper.name} has none"
    if effect.needs_rotors and not gripper.has_rotors:
        return f"needs motors that slide fingers and have an `armature`; those of {gripper.name} do not"
    if effect.needs_parallel_pads and not (gripper.pads_stay_parallel or gripper.object_is_guided):
        return f"needs pads that stay parallel, or an object on a slide; the pads of {gripper.name} turn"
    if effect.servo_only and not gripper.is_servo:
        return f"is one of servos alone; {gripper.name} has fingers"
    if effect.needs_load_behind_rotor and not gripper.has_load_behind_rotor:
        return f"needs one joint that moves a load besides its own `armature`; {gripper.name} has none"
    if effect.needs_position_loop and gripper.command != "position":
        return f"needs positions that are commanded; of {gripper.name} it is the effort"
    if effect.needs_velocity_gain and not gripper.has_velocity_gain:
        return f"needs servos that act on their velocity; those of {gripper.name} have no `kv`"
    if effect.base_parameter in gripper.parameters:
        return f"is the base parameter {effect.base_parameter} of {gripper.name}"
    if effect.repeats_damping and gripper.fits_damping:
        return f"is damping, which a base parameter of {gripper.name} has"
    if effect.least_channels > len(gripper.forces):
        return f"needs {effect.least_channels} force readings; {gripper.name} has {len(gripper.forces)}"
    if effect.least_motors > (1 if gripper.is_servo else len(gripper.motors)):
        return f"needs {effect.least_motors} motors that move fingers; {gripper.name} has not as many"
    if not _variants(effect, _Traits.of(gripper)):
        return f"needs pads, or positions that are commanded; {gripper.name} has neither"
    return ""


def effect_of(name: str, gripper: Gripper) -> type[Effect]:
    """An effect as this gripper has it.

    Raises:
      ConfigError: if there is none of that name, or it can't show on this gripper.
    """
    known = effects_of(gripper) | {NoEffect.name: NoEffect}
    if name in known:
        return known[name]
    if name in catalogue():
        raise ConfigError(f"effect {name}: {why_left_out(catalogue()[name], gripper)}")
    raise no_such_effect(f"effect {name}", name, known)


def _variants(effect: type[Effect], traits: _Traits) -> tuple[str, ...]:
    """The variants that can show."""
    there = {
        "": True,
        "pads": traits.pads,
        "position loop": not traits.commands_effort,
        "stiffness of objects": traits.own_stiffness,
    }
    return tuple(v for v in effect.variants if there[effect.variant_needs.get(v, "")])


@functools.cache
def _adapt(effect: type[Effect], traits: _Traits) -> type[Effect]:
    as_written = dataclasses.replace(traits, own_stiffness=False) == _AS_WRITTEN
    if as_written and _variants(effect, traits) == effect.variants:
        return effect
    each = {"motor": traits.motors, "channel": traits.channels}
    if not traits.pads:  # joints of a mechanism have no left and right: what an effect does to them is alike
        each = {what: min(1, count) for what, count in each.items()}
    count = each.get(effect.per, len(effect.parameters))
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
        "motors": traits.motors, "channels": traits.channels, "commands_effort": traits.commands_effort,
        "variants": _variants(effect, traits),
        "trials": classmethod(trials), "index": classmethod(index),
    })  # fmt: skip


def _factor(parameter: Parameter, traits: _Traits) -> float:
    factors = {"position": traits.position, "effort": traits.effort, "force": traits.force, "": 1.0}
    factors |= {"compliance": 1 / traits.force, "damping": traits.effort / traits.position}
    factors |= {"motor compliance": traits.position / traits.effort}
    return factors[parameter.follows]


def _rename(parameter: Parameter, factor: float, effect: type[Effect], traits: _Traits, alone: bool) -> Parameter:
    name, unit = parameter.name, parameter.unit
    if traits.turns and parameter.follows in ("position", "damping"):
        name, unit = name.replace("_m", "_rad"), unit.replace("m", "rad", 1)
    if traits.turns and parameter.follows == "motor compliance":
        name, unit = name.replace("_m_n", "_rad_nm"), "rad/(N·m)"
    if traits.turns and parameter.follows in ("effort", "damping"):
        name, unit = name.replace("_n", "_nm").replace("force", "torque"), unit.replace("N", "N·m")
    if alone:
        name = name.replace("left", effect.alone)
    doc = parameter.doc.replace("the left ", "the ") if alone else parameter.doc
    sizes = {key: getattr(parameter, key) * factor for key in ("low", "high", "typical")}
    null = parameter.null if parameter.null in (0.0, np.inf) else parameter.null * factor
    missing = None if parameter.if_missing is None else parameter.if_missing * factor
    trials = tuple(size * factor for size in parameter.trials)
    return dataclasses.replace(
        parameter, name=name, unit=unit, doc=doc, null=null, if_missing=missing, trials=trials, **sizes
    )
