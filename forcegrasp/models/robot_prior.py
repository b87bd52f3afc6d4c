"""What a robot may have that the nominal gripper has not: how likely, how strong, and why that is thought so.

Sizes are multiples of the effect's typical one on the gripper in question, so that one table serves every gripper.
"Assumed" says that no measurement stands behind a line. Nothing here was fitted to how any policy fares.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from forcegrasp.effects import Effect


@dataclass(frozen=True)
class Prior:
    """How likely a robot has an effect, and how strong it is if it does."""

    chance: float
    low: float  #: sizes are drawn between these multiples of the typical one, evenly in their logarithm
    high: float
    why: str
    fixed: Mapping[str, float] = field(default_factory=dict)  #: parameters that are alike for all robots
    variants: tuple[str, ...] = ()  #: which it may be, all of them alike; any if none is said
    either_sign: bool = True  #: whether what may be negative is, on half of the robots

    def variants_of(self, effect: type[Effect]) -> tuple[str, ...]:
        """The variants of an effect that robots may have."""
        return self.variants or effect.variants


#: By effect of the catalogue. No robot has what is not here: mistakes of a measurement set, effects of drives alone,
#: smooth_friction, which coulomb_friction and presliding stand for, lest a robot rubs three times, nor the smooth forms
#: of stiction, load_friction and force_limit, smooth_object_friction, which object_friction stands for, finger_creep,
#: which finger_compliance and viscoelastic_contact do, rate_limited_lag, which rate_limit and actuator_lag do,
#: contact_friction, table_friction and object_mass, which object_body stands for, hunt_crossley_contact, for robots
#: keep the scene's contact and stiffen it, and rounded_force_hysteresis, which force_hysteresis stands for. Nor has one
#: an effect that came later (encoder_scale, return_spring, contact_damping, contact_onset, two_mass_backlash,
#: viscous_friction, object_pull, the asymmetries of motors, friction, lost motion, compliance, delay and dead zone), or
#: such a variant: policies were compared on robots as they are.
EFFECTS = {
    "command_deadband": Prior(0.3, 1 / 3, 3, "the paper's robot: its driver sends no command below 0.3 mm"),
    "command_delay": Prior(0.6, 0.1, 0.7, "assumed: from a bus cycle to one control step of 40 ms"),
    "rate_limit": Prior(0.2, 2, 20, "assumed: slower drives would not get to the object within an episode"),
    "actuator_lag": Prior(0.3, 0.1, 1, "assumed: position loops of 3 to 30 Hz, of first order", variants=("",)),
    "coulomb_friction": Prior(0.4, 1 / 3, 3, "found in real drives (real-data.md); sizes assumed: geared hobby servos"),
    "stiction": Prior(0.2, 1 / 3, 2, "found in a real drive (real-data.md); sizes assumed"),
    "force_limit": Prior(0.1, 2, 10, "assumed: firmware limits; tighter ones would leave the goals out of reach"),
    "motor_offset": Prior(0.2, 0.2, 1, "found in a real drive (real-data.md); sizes assumed"),
    "load_friction": Prior(
        0.3,
        0.2,
        2,
        "gears lose 3 to 30 % of what they transmit, from one spur gear to several stages",
        variants=("carried",),
    ),
    "presliding": Prior(0.15, 1 / 3, 3, "assumed: as Coulomb friction"),
    "direction_friction": Prior(0.15, 0.2, 1, "found in a real drive (real-data.md); sizes assumed"),
    "position_deadband": Prior(0.2, 0.2, 2, "found in a jaw (real-data.md); sizes assumed", variants=("",)),
    "back_emf": Prior(0.15, 2, 10, "assumed: as the limit of force"),
    "backlash": Prior(0.4, 0.2, 2, "assumed: 0.1 to 1.2 mm at a fingertip 45 mm from open to closed"),
    "finger_compliance": Prior(0.3, 0.1, 2, "assumed: printed fingers and soft pads, 500 to 10 000 N/m"),
    "stiffening_contact": Prior(
        0.5,
        0.3,
        2,
        "round and soft bodies stiffen as they are pressed (Hertz: power 1.5)",
        fixed={"spring_power": 3.0},
        either_sign=False,
    ),
    "viscoelastic_contact": Prior(
        0.3, 0.2, 1, "assumed: foam and rubber creep, hard objects do not", variants=("recovering",)
    ),
    "adhesion": Prior(0.1, 0.2, 1, "assumed: soft pads stick a little, rarely"),
    "object_friction": Prior(0.7, 0.3, 5, "μ m g of 10 to 170 g at μ 0.3, on what the object stands on"),
    "force_crosstalk": Prior(0.3, 0.2, 2, "assumed: 2 to 16 %, of both alike", fixed={"difference": 0.0}),
    "force_hysteresis": Prior(
        0.3, 0.3, 2, "assumed: 5 to 30 %; data sheets of force-sensing resistors say 10 %", variants=("lasting",)
    ),
    "force_gain_asymmetry": Prior(0.5, 0.2, 2, "assumed: sensors calibrated to 2 to 20 %"),
    "force_lag": Prior(0.5, 0.1, 1.25, "assumed: filters of 1.6 to 20 Hz, of first order", variants=("",)),
    "force_delay": Prior(0.3, 0.1, 0.7, "assumed: as that of commands"),
    "force_deadzone": Prior(0.3, 0.25, 1.5, "the paper's robot: 65 mN (real-table.md)"),
    "force_drift": Prior(0.2, 0.05, 0.5, "assumed: a few per cent of the range within a grasp"),
    "force_bias": Prior(0.4, 0.1, 1, "assumed: what is left after a sensor was set to zero"),
    "force_saturation": Prior(0.1, 2, 10, "assumed; lower ones would hide most goals", fixed={"knee": 0.0}),
    "readout_skew": Prior(0.3, 0.2, 1.3, "found in logs of a jaw, up to a sample of 20 ms (real-data.md)"),
    "encoder_bias": Prior(0.3, 0.2, 2, "assumed: homing to 0.06 to 0.6 mm"),
    "quantisation": Prior(0.7, 0.1, 1, "assumed: encoders of 9 to 12 bits over the travel, 25 to 250 steps a newton"),
    "object_body": Prior(1, 1, 1, "every object has a mass and a friction; the ranges are MASS and FRICTION"),
}
#: Factors of what the gripper's description says, drawn evenly in their logarithm.
GAINS = (0.8, 1.25, "assumed; what training draws from its own range is drawn from that (the paper's b₂)")
NOISE = (0.5, 2.0, "assumed: of positions and of forces apart")
MASS = (0.25, 2.0, "0.1 to 0.8 kg where the scene has 0.4 kg: from a small box to a full bottle")
FRICTION = (0.5, 1.5, "assumed: all contacts alike, from polished metal to rubber")
#: Parameters that shape an effect and have no size (a Stribeck velocity) are drawn within this of the typical value.
SHAPE = (0.5, 2.0)
