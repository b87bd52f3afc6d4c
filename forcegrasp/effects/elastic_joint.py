"""A joint whose load hangs on the motor by a spring."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Parameter, State

COMPLIANCE = Parameter(
    "compliance_m_n", "compliance of the spring c", "m/N", 0.0, 0.05, 0.005, trials=(0.002, 0.006),
    follows="motor compliance",
)  # fmt: skip
LOSS = Parameter("loss_s", "damper of the spring ÷ its stiffness τ", "s", 0.0, 0.02, 0.001, null=0.001, trials=(1e-3,))
# Over so much of a motor's way the change of a load's weight is measured, m or rad.
_WAY = 1e-3


class ElasticJoint(Effect):
    """Motor and load are two bodies with a spring between them; the encoder sits at the motor.

    The joint of the scene is the rotor: its `armature`, friction and damping stay where they are. What else the joint
    moves, its weight and loads from outside are at the other end of the spring. Unlike `elastic_transmission`, it adds
    no inertia: a heavier load swings more slowly. A spring too stiff for the physics steps is as stiff as they allow.
    """

    name = "elastic_joint"
    stage = "transmission"
    family = "elasticity"
    servo_only = needs_load_behind_rotor = True
    symptom = "the joint and its effort ring after fast motion, more slowly with a heavier load"
    formula = "J_r q'' = F − F_s, J_l x'' = F_s + F_out, F_s = (q − x + τ (q' − x')) / c"
    source = "two-mass drive: Spong (1987), elastic joints"
    look_alikes = ("elastic_transmission", "loose_joint", "backlash", "presliding", "actuator_lag")
    separates = "fast steps with several loads, and where the motor is switched off"
    parameters = (COMPLIANCE, LOSS)
    order = 3

    def init(self, which: np.ndarray) -> State:
        position, rows = self.position[which], self.rows[which]
        weight = self.plant.weight[rows]
        return {
            "load": position + self["compliance_m_n"][which] * weight + self.half_gap[which] * np.sign(weight),
            "speed": np.broadcast_to(self.velocity[which], position.shape).copy(),
            # where the load's weight was measured last, and how it changes along the way
            "position": position,
            "weight": weight,
            "slope": np.zeros_like(position),
        }

    @property
    def half_gap(self) -> np.ndarray:
        """Half of the way that the motor is free to move between both ends of the spring, ``(rows, 1)``."""
        return np.zeros_like(self["compliance_m_n"])

    def act(self) -> Contribution:
        plant, rows, state, dt = self.plant, self.rows, self.state, self.dt
        rotor = plant.rotor_inertia[rows]
        behind = plant.inertia[rows] - rotor
        stiffness, drag = self._spring(rotor * behind / (rotor + behind))
        apart, rate = state["load"] - self.position, state["speed"] - self.velocity
        bend = apart - np.clip(apart, -self.half_gap, self.half_gap)
        touches = (self.half_gap == 0) | (bend * (stiffness * bend + drag * rate) > 0)
        spring, drag = np.where(touches, stiffness * bend, 0.0), np.where(touches, drag, 0.0)
        outside = plant.outside_force[rows]
        # Both bodies by the same semi-implicit step as MuJoCo's: it takes nothing from a spring that swings undamped.
        push = outside + self._slope() * apart - spring + drag * self.velocity
        state["speed"] = speed = (state["speed"] + dt / behind * push) / (1 + dt * drag / behind)
        state["load"] = state["load"] + dt * speed
        there = (self["compliance_m_n"] > 0) | (self.half_gap > 0)
        return Contribution(
            motor_push=np.where(there, spring + drag * speed - outside, 0.0),
            damping=np.where(there, drag, 0.0),
            inertia=np.where(there, -behind, 0.0),
        )

    def _spring(self, mass: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness and damper that steps can follow, if this mass swings on it, ``(rows, motors)``."""
        stiffest = mass / self.dt**2
        stiffness = 1 / np.maximum(self["compliance_m_n"], 1 / stiffest)
        return stiffness, np.minimum(self["loss_s"] * stiffness, np.sqrt(mass * stiffness))

    def _slope(self) -> np.ndarray:
        """What the weight changes by per way of the joint, ``(rows, motors)``: the load is not where the motor is."""
        state, position, weight = self.state, self.position, self.plant.weight[self.rows]
        way = position - state["position"]
        far = np.abs(way) > _WAY
        state["slope"] = np.where(far, (weight - state["weight"]) / np.where(far, way, 1.0), state["slope"])
        state["position"] = np.where(far, position, state["position"])
        state["weight"] = np.where(far, weight, state["weight"])
        return state["slope"]
