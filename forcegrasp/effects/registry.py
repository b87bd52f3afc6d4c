"""The catalogue of effects: those that ship with the package, and those that other packages register."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from importlib import import_module
from importlib.metadata import entry_points

from forcegrasp.effects.base import STAGES, Effect
from forcegrasp.effects.none import NoEffect
from forcegrasp.errors import ConfigError, closest

#: Other packages add effects under this entry point group: name = "module:Class".
ENTRY_POINTS = "forcegrasp.effects"

# Modules beside this one, each with a class of its name: coulomb_friction.py has CoulombFriction.
_SHIPPED = (
    "actuator_lag",
    "adhesion",
    "back_emf",
    "backlash",
    "backlash_asymmetry",
    "command_deadband",
    "command_delay",
    "compliance_asymmetry",
    "contact_damping",
    "contact_friction",
    "contact_onset",
    "coulomb_friction",
    "deadzone_asymmetry",
    "delay_asymmetry",
    "direction_friction",
    "elastic_transmission",
    "elastic_joint",
    "loose_joint",
    "encoder_bias",
    "encoder_scale",
    "finger_compliance",
    "finger_creep",
    "force_bias",
    "force_crosstalk",
    "force_deadzone",
    "force_delay",
    "force_drift",
    "force_gain_asymmetry",
    "force_hysteresis",
    "force_lag",
    "force_limit",
    "force_saturation",
    "friction_asymmetry",
    "hunt_crossley_contact",
    "load_friction",
    "motor_asymmetry",
    "motor_offset",
    "object_friction",
    "object_mass",
    "object_pull",
    "smooth_object_friction",
    "object_size",
    "position_deadband",
    "presliding",
    "quantisation",
    "rate_limit",
    "rate_limited_lag",
    "readout_skew",
    "return_spring",
    "rounded_force_hysteresis",
    "second_order_lag",
    "smooth_force_limit",
    "smooth_friction",
    "smooth_load_friction",
    "smooth_stiction",
    "stiction",
    "stiffening_contact",
    "swapped_forces",
    "table_friction",
    "two_mass_backlash",
    "velocity_lag",
    "viscoelastic_contact",
    "viscous_friction",
)


@functools.cache
def catalogue() -> dict[str, type[Effect]]:
    """Every known effect by name, in the order in which they act; `none` is not among them.

    Raises:
      ConfigError: if an effect of another package can't be used; names the package's entry point.
    """
    found = {name: _shipped(name) for name in _SHIPPED}
    for point in entry_points(group=ENTRY_POINTS):
        try:
            effect = point.load()
        except Exception as error:  # whatever the other package raises is its user's problem to know
            raise ConfigError(f"effect {point.name} ({point.value}): could not be loaded: {error!r}") from error
        if not (isinstance(effect, type) and issubclass(effect, Effect)):
            raise ConfigError(f"effect {point.name} ({point.value}): must be a subclass of forcegrasp.effects.Effect")
        if getattr(effect, "name", None) != point.name or point.name in found or effect.stage not in STAGES:
            raise ConfigError(
                f"effect {point.name} ({point.value}): must have that very name, free in the catalogue, and a stage"
                f" out of {', '.join(STAGES)}"
            )
        found[effect.name] = effect
    return dict(sorted(found.items(), key=lambda item: (STAGES.index(item[1].stage), item[1].order)))


def _shipped(name: str) -> type[Effect]:
    return getattr(import_module(f"forcegrasp.effects.{name}"), name.title().replace("_", ""))


def no_such_effect(asked: str, name: str, known: Iterable[str]) -> ConfigError:
    """What to raise where somebody asked for an effect of this name, in these words."""
    return ConfigError(f"{asked}: no such effect{closest(name, known, 'forcegrasp effects')}")


def get_effect(name: str) -> type[Effect]:
    """Returns an effect by name.

    Raises:
      ConfigError: names the closest known ones.
    """
    if name == NoEffect.name:
        return NoEffect
    if name not in catalogue():
        raise no_such_effect(f"effect {name}", name, catalogue())
    return catalogue()[name]
