"""A position loop that gives no force near its goal."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter


class PositionDeadband(Effect):
    """Near enough to its command the position loop rests: no force, but for its damping, until the error is larger.

    Beyond the band the whole error counts, or with ``subtract`` what it is beyond the band, so that the force grows
    from zero. The command stays in force; a driver that drops commands is `command_deadband`.
    """

    name = "position_deadband"
    stage = "actuator"
    family = "lost motion"
    needs_position_loop = True
    symptom = "motion ends before the command is reached, by up to the band, and nothing brings it nearer"
    formula = "F = 0 if |u − q| ≤ b, else k (u − q), or k (u − q ∓ b) (subtract)"
    source = (
        "dead zone of hobby and bus servos, such as the registers 'CW/CCW dead zone' of Feetech's STS3215; that of"
        " block diagrams (Simulink's Dead Zone) subtracts"
    )
    look_alikes = ("coulomb_friction", "command_deadband", "stiction", "backlash")
    separates = (
        "a light push moves it within the band, and friction would hold; large and small errors are followed at full"
        " force, where friction always takes its part"
    )
    parameters = (
        Parameter("band_m", "half width b", "m", 0.0, 0.005, 0.0005, trials=(3e-4, 1.5e-3), follows="position"),
    )
    variants = ("", "subtract")
    order = 7  # what the loop acts on, after all that happens to the command

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        position, band = self.position, self["band_m"]
        if self.variant == "subtract":  # the command itself where there is no band, to the last bit
            return command - np.clip(command - position, -band, band)
        return np.where(np.abs(command - position) <= band, position, command)
