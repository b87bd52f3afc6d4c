"""The servo acts on a velocity that is late."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter, State, delay_line, delayed


class VelocityLag(Effect):
    """The servo's velocity is worked out from its encoder, by differences and filters, and so comes late.

    While the speed grows the servo knows less of it, and brakes less: a small lag is as good as an inertia k_v τ
    smaller, a large one makes the loop ring. Variant ``difference`` takes the way of the last 2τ, which is the velocity
    of τ ago; ``filter`` is a first-order lag.
    """

    name = "velocity_lag"
    stage = "actuator"
    family = "delay"
    servo_only = True
    needs_position_loop = needs_velocity_gain = True
    variants = ("difference", "filter")
    symptom = "fast motion starts and turns sooner than its inertia allows; steady motion is right"
    formula = "F = k (u − q) − k_v v', v' = (q(t) − q(t − 2τ)) / 2τ, or τ dv'/dt = v − v'"
    source = "velocity from an encoder: Brown, Schneider and Mulligan (1992); in the loop of EMPS, a millisecond"
    look_alikes = ("actuator_lag", "command_delay", "elastic_transmission")
    separates = (
        "a command that is late is late at any speed, this shows only where the speed changes; a smaller inertia needs"
        " less effort for it, where effort is read"
    )
    parameters = (Parameter("lag_s", "how late the velocity is, τ", "s", 0.0, 0.1, 0.01, trials=(0.002, 0.008)),)
    # MuJoCo's implicit integrator acts on the velocity at the end of a step, others on that at its start
    least_steps = 2.0
    order = 9  # inside the loop, after all that happens to the command

    def init(self, which: np.ndarray) -> State:
        velocity = self.velocity[which]
        if self.variant == "filter":
            return {"late": velocity}
        windows, longest = 2 * self["lag_s"][which] / self.dt, 2 * self.longest("lag_s") / self.dt
        line = delay_line(self.position[which], windows, longest)
        return line | {"at_first": velocity, "time": np.zeros((len(which), 1))}

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        velocity = self.velocity
        gains = self.plant.field("actuator_biasprm")[self.rows][:, self.plant.actuators]
        return command + gains[..., 2] / gains[..., 1] * (velocity - self._late(velocity))

    def _late(self, velocity: np.ndarray) -> np.ndarray:
        """The velocity that the servo knows, ``(rows, motors)``."""
        lag, state = self["lag_s"], self.state
        if self.variant == "filter":
            state["late"] = late = state["late"] + self.lag_weight("lag_s") * (velocity - state["late"])
            return late
        # before the start it moved as at the start: so what is kept is the way besides that steady motion
        besides = self.position - state["at_first"] * state["time"]
        state["time"] += self.dt
        way = besides - delayed(state, besides)
        return np.where(lag > 0, way / np.where(lag > 0, 2 * lag, 1.0) + state["at_first"], velocity)
