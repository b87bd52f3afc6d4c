"""Effects by name, and parameters that make them small, medium and large."""

from __future__ import annotations

from . import drive, otherwise, outside, sensing, touch
from .effect import Effect

Sizes = dict[str, dict[str, float]]


def _sizes(parameter: str, small: float, medium: float, large: float, **ratios: float) -> Sizes:
    """The three sizes of one parameter; ``ratios`` gives further parameters as multiples of it."""
    sizes = {"small": small, "medium": medium, "large": large}
    return {
        name: {parameter: value, **{other: round(ratio * value, 9) for other, ratio in ratios.items()}}
        for name, value in sizes.items()
    }


# In the order in which they act.
CLASSES: dict[str, type[Effect]] = {
    "command_deadband": drive.CommandDeadband,
    "command_delay": drive.CommandDelay,
    "rate_limit": drive.RateLimit,
    "actuator_lag": drive.ActuatorLag,
    "second_order_drive": otherwise.SecondOrderDrive,
    "restless_delay": otherwise.RestlessDelay,
    "soft_rate": otherwise.SoftRate,
    "encoder_bias_in_loop": sensing.EncoderBiasInLoop,
    "force_limit": drive.ForceLimit,
    "coulomb_friction": drive.CoulombFriction,
    "stiction": drive.Stiction,
    "load_friction": drive.LoadFriction,
    "motor_offset": drive.MotorOffset,
    "presliding": drive.Presliding,
    "direction_friction": drive.DirectionFriction,
    "position_deadband": drive.PositionDeadband,
    "back_emf": drive.BackEmf,
    "swinging_load": drive.SwingingLoad,
    "stale_velocity": drive.StaleVelocity,
    "smooth_friction": otherwise.SmoothFriction,
    "smooth_stribeck": otherwise.SmoothStribeck,
    "tilt": otherwise.Tilt,
    "motor_cogging": outside.MotorCogging,
    "motor_fade": outside.MotorFade,
    "directional_gain": outside.DirectionalGain,
    "rough_guide": outside.RoughGuide,
    "backlash": drive.Backlash,
    "backlash_loose": drive.LooseBacklash,
    "backlash_behind": drive.FingerEncoderBacklash,
    "finger_compliance": drive.FingerCompliance,
    "damped_finger": otherwise.DampedFinger,
    "ringing_finger": otherwise.RingingFinger,
    "stiffening_contact": touch.StiffeningContact,
    "viscoelastic_contact": touch.ViscoelasticContact,
    "adhesion": touch.Adhesion,
    "contact_friction": touch.ContactFriction,
    "object_friction": touch.ObjectFriction,
    "hertz_pads": otherwise.HertzPads,
    "suction": otherwise.Suction,
    "smooth_table": otherwise.SmoothTable,
    "tip_inertia": outside.TipInertia,
    "force_crosstalk": sensing.ForceCrosstalk,
    "force_hysteresis": sensing.ForceHysteresis,
    "force_deadzone": sensing.ForceDeadzone,
    "force_threshold": sensing.ForceThreshold,
    "soft_deadzone": otherwise.SoftDeadzone,
    "wide_hysteresis": otherwise.WideHysteresis,
    "force_gain_asymmetry": sensing.ForceGainAsymmetry,
    "curved_force_gain": outside.CurvedForceGain,
    "force_saturation": sensing.ForceSaturation,
    "soft_saturation": otherwise.SoftSaturation,
    "second_order_sensor": otherwise.SecondOrderSensor,
    "force_lag": sensing.ForceLag,
    "force_delay": sensing.ForceDelay,
    "force_bias": sensing.ForceBias,
    "force_drift": sensing.ForceDrift,
    "settling_drift": otherwise.SettlingDrift,
    "readout_skew": sensing.ReadoutSkew,
    "encoder_bias": sensing.EncoderBias,
    "eccentric_encoder": outside.EccentricEncoder,
    "stale_positions": outside.StalePositions,
    "quantisation": sensing.Quantisation,
}

CATALOGUE: dict[str, Sizes] = {
    "command_delay": _sizes("latency", 0.005, 0.02, 0.06),
    "command_deadband": _sizes("band", 1e-4, 3e-4, 1e-3),
    "rate_limit": _sizes("speed", 0.4, 0.1, 0.025),
    "coulomb_friction": _sizes("level", 0.01, 0.03, 0.1),
    "stiction": _sizes("breakaway", 0.015, 0.045, 0.15, sliding=0.4),
    "load_friction": _sizes("coefficient", 0.05, 0.15, 0.4),
    "presliding": _sizes("level", 0.01, 0.03, 0.1),
    "smooth_friction": _sizes("level", 0.015, 0.045, 0.15),
    "direction_friction": _sizes("excess", 2.0, 5.0, 15.0),
    "position_deadband": _sizes("band", 1e-4, 4e-4, 1.5e-3),
    "back_emf": _sizes("stall", 0.4, 0.2, 0.08),
    "motor_offset": _sizes("left", 0.01, 0.03, 0.1, right=-0.6),
    "actuator_lag": _sizes("time_constant", 0.005, 0.02, 0.06),
    "force_limit": _sizes("limit", 0.7, 0.4, 0.15),
    "backlash": _sizes("gap", 5e-5, 1.5e-4, 5e-4),
    "finger_compliance": _sizes("compliance", 3e-4, 1e-3, 3e-3),
    "stiffening_contact": _sizes("at_one_mm", 0.01, 0.03, 0.1),
    "viscoelastic_contact": _sizes("stiffness", 15.0, 50.0, 150.0),
    "adhesion": _sizes("pull", 0.01, 0.03, 0.1),
    "contact_friction": _sizes("share", 0.75, 0.5, 3.0),
    "object_friction": _sizes("level", 0.02, 0.06, 0.2),
    "force_lag": _sizes("time_constant", 0.01, 0.03, 0.1),
    "force_delay": _sizes("latency", 0.01, 0.03, 0.1),
    "force_bias": _sizes("left", 0.04, 0.12, 0.4, right=0.4),
    "force_drift": _sizes("left", 0.008, 0.024, 0.08, right=0.6),
    "force_deadzone": _sizes("threshold", 0.04, 0.12, 0.4),
    "force_saturation": _sizes("full_scale", 1.2, 0.7, 0.35),
    "force_hysteresis": _sizes("spread", 0.05, 0.15, 0.5),
    "force_crosstalk": _sizes("share", 0.04, 0.12, 0.35),
    "force_gain_asymmetry": _sizes("right_excess", 0.04, 0.12, 0.4),
    "encoder_bias": _sizes("left", 1e-4, 3e-4, 1e-3, right=0.4),
    "readout_skew": _sizes("age", 0.01, 0.03, 0.08),
    "quantisation": {
        "small": {"position_step": 5e-5, "force_step": 0.02},
        "medium": {"position_step": 1.5e-4, "force_step": 0.05},
        "large": {"position_step": 5e-4, "force_step": 0.2},
    },
}

#: Other honest readings of effects of the catalogue: the name up to its variant is the right answer.
VARIANTS: dict[str, Sizes] = {
    "backlash_loose": _sizes("gap", 1e-4, 3e-4, 1e-3),
    "backlash_behind": _sizes("gap", 1e-4, 3e-4, 1e-3),
    "force_threshold": _sizes("threshold", 0.04, 0.1, 0.25),
    "encoder_bias_in_loop": CATALOGUE["encoder_bias"],
}
VARIANT_OF = {
    "backlash_loose": "two_mass_backlash",
    "backlash_behind": "two_mass_backlash",
    "force_threshold": "force_deadzone",
    "encoder_bias_in_loop": "encoder_bias",
}

#: Effects of the catalogue by another law: the right answer, and sizes.
OTHERWISE: dict[str, tuple[str, Sizes]] = {
    "smooth_stribeck": ("smooth_friction", _sizes("breakaway", 0.03, 0.06, 0.15, sliding=0.4)),
    "tilt": ("motor_offset", _sizes("weight", 0.02, 0.05, 0.1)),
    "second_order_drive": ("actuator_lag", CATALOGUE["actuator_lag"]),
    "restless_delay": ("command_delay", CATALOGUE["command_delay"]),
    "soft_rate": ("rate_limit", CATALOGUE["rate_limit"]),
    "damped_finger": ("finger_compliance", CATALOGUE["finger_compliance"]),
    "ringing_finger": ("finger_compliance", CATALOGUE["finger_compliance"]),
    "hertz_pads": ("stiffening_contact", CATALOGUE["stiffening_contact"]),
    "suction": ("adhesion", CATALOGUE["adhesion"]),
    "smooth_table": ("object_friction", CATALOGUE["object_friction"]),
    "soft_deadzone": ("force_deadzone", CATALOGUE["force_deadzone"]),
    "wide_hysteresis": ("force_hysteresis", _sizes("width", 0.03, 0.08, 0.2)),
    "soft_saturation": ("force_saturation", _sizes("full_scale", 4.0, 2.0, 1.0)),
    "second_order_sensor": ("force_lag", CATALOGUE["force_lag"]),
    "settling_drift": ("force_drift", _sizes("left", 0.03, 0.08, 0.25, right=0.6)),
}

OUTSIDE: dict[str, Sizes] = {
    "swinging_load": _sizes("share", 0.1, 0.3, 1.0),  # elastic_transmission, which is one of servos alone
    "stale_velocity": _sizes("window", 0.006, 0.015, 0.03),  # velocity_lag, one of servos alone, too
    "motor_cogging": _sizes("amplitude", 0.01, 0.03, 0.1),
    "motor_fade": _sizes("loss", 0.05, 0.15, 0.4),
    "directional_gain": _sizes("closing_excess", 0.03, 0.1, 0.3),
    "rough_guide": _sizes("drag", 1.0, 3.0, 10.0),
    "eccentric_encoder": _sizes("amplitude", 8e-5, 2.5e-4, 8e-4),
    "curved_force_gain": _sizes("per_newton", 0.04, 0.12, 0.4),
    "tip_inertia": _sizes("mass", 0.02, 0.06, 0.2),
    "stale_positions": _sizes("chance", 0.01, 0.04, 0.12),
}


def build_effects(chosen: dict[str, str | dict]) -> dict[str, Effect]:
    """Effects from sizes or parameters, in the order in which they act."""
    sizes = CATALOGUE | VARIANTS | OUTSIDE | {name: sizes for name, (_, sizes) in OTHERWISE.items()}
    unknown = set(chosen) - set(CLASSES)
    if unknown:
        raise ValueError(f"no effect {sorted(unknown)}: choose from {sorted(CLASSES)}")
    return {
        name: kind(**(sizes[name][chosen[name]] if isinstance(chosen[name], str) else chosen[name]))
        for name, kind in CLASSES.items()
        if name in chosen
    }
