"""A load that hangs on the motor by a spring."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Parameter, State

#: Damping ratio of the load on its spring.
DAMPING_RATIO = 0.1


class ElasticTransmission(Effect):
    """A spring between the motor, where the encoder sits, and a part of the inertia that it moves.

    The load's swing follows exactly from each step's motion, and pushes back on the motor. A spring that is only bent,
    without swinging, is not seen by an encoder on its motor; with the encoder behind it, it is a softer servo, which
    the fit of the base model finds. Where fingers press on something, `finger_compliance` is the same spring.
    """

    name = "elastic_transmission"
    stage = "transmission"
    family = "elasticity"
    servo_only = True
    symptom = "the joint rings at one frequency after fast motion, whatever the servo's gain"
    formula = "F = s J (ω² (x − q) + 2 ζ ω (dx/dt − dq/dt)), d²x/dt² = −F / (s J), ω = 2 π f, ζ = 0.1"
    source = "two-mass drive: Spong (1987), elastic joints"
    look_alikes = ("elastic_joint", "backlash", "presliding", "actuator_lag")
    separates = (
        "steps at several gains: what rings at one frequency is behind a spring, what changes with it is the servo"
    )
    parameters = (
        Parameter("load_share", "inertia behind the spring per inertia before it s", "1", 0.0, 4.0, 0.5, trials=(0.3,)),
        Parameter(
            "frequency_hz", "frequency f of the load while the motor is held", "Hz", 0.5, 100.0, 6.0, null=6.0,
            logarithmic=True, trials=(4.0, 12.0),
        ),
    )  # fmt: skip
    order = 2

    def init(self, which: np.ndarray) -> State:
        position = self.position[which]
        at_rest = np.zeros_like(position)
        return {"position": position, "bend": at_rest, "speed": self.velocity[which] + at_rest}

    def act(self) -> Contribution:
        omega, state = 2 * np.pi * self["frequency_hz"], self.state
        position = self.position
        bend, speed = _swing(state["bend"], state["speed"], (position - state["position"]) / self.dt, omega, self.dt)
        state.update(position=position, bend=bend, speed=speed)
        behind = self["load_share"] * self.plant.inertia[self.rows]
        drag = 2 * DAMPING_RATIO * omega
        return Contribution(
            motor_push=behind * (omega**2 * (bend + self.dt * speed) + drag * speed),
            damping=behind * (omega**2 * self.dt + drag),
        )


def _swing(
    bend: np.ndarray, speed: np.ndarray, motor: np.ndarray, omega: np.ndarray, dt: float
) -> tuple[np.ndarray, np.ndarray]:
    """Bend of the spring and speed of the load after a step in which the motor moved at a steady speed; exact."""
    along, swing = DAMPING_RATIO * omega, omega * np.sqrt(1 - DAMPING_RATIO**2)
    relative = speed - motor
    fade, sine, cosine = np.exp(-along * dt), np.sin(swing * dt), np.cos(swing * dt)
    after = fade * (bend * cosine + (relative + along * bend) / swing * sine)
    rate = fade * (relative * cosine - (along * relative + omega**2 * bend) / swing * sine)
    return after, rate + motor
