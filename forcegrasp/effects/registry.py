"""The catalogue of effects: those that ship with the package, and those that other packages register."""

from __future__ import annotations

import functools
from importlib.metadata import entry_points

from forcegrasp.effects.actuator_lag import ActuatorLag
from forcegrasp.effects.adhesion import Adhesion
from forcegrasp.effects.backlash import Backlash
from forcegrasp.effects.base import STAGES, Effect
from forcegrasp.effects.command_deadband import CommandDeadband
from forcegrasp.effects.command_delay import CommandDelay
from forcegrasp.effects.coulomb_friction import CoulombFriction
from forcegrasp.effects.encoder_bias import EncoderBias
from forcegrasp.effects.finger_compliance import FingerCompliance
from forcegrasp.effects.force_bias import ForceBias
from forcegrasp.effects.force_crosstalk import ForceCrosstalk
from forcegrasp.effects.force_deadzone import ForceDeadzone
from forcegrasp.effects.force_delay import ForceDelay
from forcegrasp.effects.force_drift import ForceDrift
from forcegrasp.effects.force_gain_asymmetry import ForceGainAsymmetry
from forcegrasp.effects.force_hysteresis import ForceHysteresis
from forcegrasp.effects.force_lag import ForceLag
from forcegrasp.effects.force_limit import ForceLimit
from forcegrasp.effects.force_saturation import ForceSaturation
from forcegrasp.effects.none import NoEffect
from forcegrasp.effects.object_friction import ObjectFriction
from forcegrasp.effects.quantisation import Quantisation
from forcegrasp.effects.rate_limit import RateLimit
from forcegrasp.effects.stiction import Stiction
from forcegrasp.effects.stiffening_contact import StiffeningContact
from forcegrasp.effects.viscoelastic_contact import ViscoelasticContact
from forcegrasp.errors import ConfigError, closest

#: Other packages add effects under this entry point group: name = "module:Class".
ENTRY_POINTS = "forcegrasp.effects"

_SHIPPED: tuple[type[Effect], ...] = (
    CommandDeadband,
    CommandDelay,
    RateLimit,
    ActuatorLag,
    CoulombFriction,
    Stiction,
    ForceLimit,
    Backlash,
    FingerCompliance,
    StiffeningContact,
    ViscoelasticContact,
    Adhesion,
    ObjectFriction,
    ForceCrosstalk,
    ForceHysteresis,
    ForceGainAsymmetry,
    ForceLag,
    ForceDelay,
    ForceDeadzone,
    ForceDrift,
    ForceBias,
    ForceSaturation,
    EncoderBias,
    Quantisation,
)


@functools.cache
def catalogue() -> dict[str, type[Effect]]:
    """Every known effect by name, in the order in which they act; `none` is not among them.

    Raises:
      ConfigError: if an effect of another package can't be used; names the package's entry point.
    """
    found = {effect.name: effect for effect in _SHIPPED}
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


def get_effect(name: str) -> type[Effect]:
    """Returns an effect by name.

    Raises:
      ConfigError: names the closest known ones.
    """
    if name == NoEffect.name:
        return NoEffect
    if name not in catalogue():
        raise ConfigError(f"effect {name}: no such effect{closest(name, catalogue())}")
    return catalogue()[name]
