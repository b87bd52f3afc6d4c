"""Lost motion between a motor and a finger that has its own inertia and that nothing holds."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Parameter, State
from forcegrasp.physics.plant import Plant

# A motor that is slower than this is held by its dry friction, which creeps in MuJoCo.
_AT_REST_M_S = 2e-5


class TwoMassBacklash(Effect):
    """A finger that moves freely in a gap, and knocks at its ends, where its motor pushes it.

    The joint of the scene is the finger. At an end of the gap it moves with its motor, as one body, until the end
    would have to pull. Between them it has no motor; what is the rotor's (MuJoCo's armature, all dry friction, its
    share of the damping) is followed here, in the steps of the engine. A knock leaves both with one velocity, from the
    moment within the step at which they meet. The encoder sits at the motor (``motor_encoder``) or at the finger
    (``finger_encoder``); the servo damps the motor's speed.
    """

    name = "two_mass_backlash"
    stage = "transmission"
    family = "lost motion"
    symptom = (
        "fingers run on in the gap and knock; the motor is quick while it crosses, and objects push it back at once"
    )
    formula = "|m − p| ≤ g/2; J_r m'' = F − (1 − s) d m' and J_f p'' = −s d p' in the gap, one body at its ends"
    source = "two-mass system with backlash: Nordin and Gutman (2002), A survey"
    look_alikes = ("backlash", "finger_compliance", "encoder_bias", "object_size")
    separates = "fast moves that stop in free air, reversals there, and partial releases in contact"
    parameters = (
        Parameter("gap_m", "width of the gap g", "m", 0.0, 0.006, 0.0006, trials=(3e-4, 1e-3), follows="position"),
        Parameter(
            "finger_share",
            "share s of the damping d that is the finger's",
            "1",
            0.0,
            1.0,
            0.5,
            null=0.5,
            trials=(0.3, 0.8),
        ),
    )
    variants = ("motor_encoder", "finger_encoder")
    needs_rotors = in_valleys = True
    order = 5

    # of the step that is being made, ``(rows, motors)``
    _command: np.ndarray
    _jump: np.ndarray  # of the fingers' velocity
    _free: np.ndarray  # which fingers are at no end of the gap

    def init(self, which: np.ndarray) -> State:
        finger, velocity = self.plant.joint_position[self.rows][which], self.velocity[which]
        nothing = np.zeros_like(finger)
        return {
            "motor": finger,  # where it is, and
            "speed": velocity,  # how fast, if it is at no end
            # at which it is: 1 if it is ahead of the finger and opens it, −1 if it closes it; without a gap always
            "end": nothing + (self["gap_m"][which] == 0),
            "before": velocity,  # of the finger, before the last step
            "to_come": nothing,  # what is left for the next step of a change of the finger's velocity
            "met": nothing,  # whether they met in the last step or the one before
            "friction": nothing,
            "damping": nothing,
            "push": nothing,  # of other effects, on the motor
        }

    def change_model(self, plant: Plant, which: np.ndarray) -> None:
        """Lets fingers go as far past the ends of their range as they can be ahead of motors that stop there."""
        if self.variant == "finger_encoder":
            return
        rows, more = self.rows[which], self["gap_m"][which] / 2 * (-1.0, 1.0)
        for joint in plant.model.dof_jntid[plant.motor_dofs]:
            plant.field("jnt_range")[rows, joint] = plant.base("jnt_range")[rows, joint] + more

    def motor_position(self, joint: np.ndarray) -> np.ndarray:
        return joint if self.variant == "finger_encoder" else self._motor_at(joint)

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        """Sees what came of the last step; says what the joint's servo, which knows the finger, is to be told."""
        state, finger, velocity, gap = self.state, self.plant.joint_position[self.rows], self.velocity, self["gap_m"]
        held, motor = state["end"] != 0, self._motor_at(finger)
        lets_go = held & (gap > 0) & (state["met"] == 0) & (state["end"] * self._passed_on(velocity) < 0)
        state["end"] = np.where(lets_go, 0.0, state["end"])
        state.update(motor=motor, speed=np.where(held, velocity, state["speed"]), before=velocity)
        self._command = command
        return command if self.variant == "finger_encoder" else command - (motor - finger)

    def motor_range(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Moves the motors that are at no end; finds those that meet an end in this step. Free fingers get no force."""
        state, dt, velocity, half = self.state, self.dt, self.velocity, self["gap_m"] / 2
        rotor, both = self._inertia
        finger, motor = self.plant.joint_position[self.rows], state["motor"]
        speed = self._speed_after(finger if self.variant == "finger_encoder" else motor, low, high)
        before, alone = motor - finger, state["end"] == 0
        after = before + dt * (speed - velocity)
        meets = alone & (np.abs(after) > half)
        end, way = np.sign(after), np.where(after == before, 1.0, after - before)
        share = np.clip((end * half - before) / way, 0.0, 1.0)  # of the step, until they meet
        together = ((both - rotor) * velocity + rotor * speed) / both
        on_average = share * velocity + (1 - share) * together
        self._jump = state["to_come"] + np.where(meets, on_average - velocity, 0.0)
        self._free = free = alone & ~meets
        state.update(
            motor=motor + dt * speed,
            speed=speed,
            end=np.where(meets, end, state["end"]),
            to_come=np.where(meets, together - on_average, 0.0),
            met=meets | (state["to_come"] != 0),
        )
        return np.where(free, 0.0, low), np.where(free, 0.0, high)

    def act(self) -> Contribution:
        """Takes what is the rotor's from fingers that are free."""
        plant, rows, free, (rotor, _) = self.plant, self.rows, self._free, self._inertia
        friction = plant.base("dof_frictionloss")[rows][:, plant.motor_dofs] + plant.friction[rows]
        damping = plant.base("dof_damping")[rows][:, plant.motor_dofs] + plant.damping[rows]
        damping, push = damping * (1 - self["finger_share"]), plant.motor_push[rows]
        self.state.update(friction=friction, damping=damping, push=push)
        return Contribution(
            friction=np.where(free, -friction, 0.0),
            damping=np.where(free, -damping, 0.0),
            motor_push=np.where(free, -push, 0.0),
            velocity_change=self._jump,
            inertia=np.where(free, -rotor, 0.0),
        )

    def _motor_at(self, finger: np.ndarray) -> np.ndarray:
        """Where motors are, ``(rows, motors)``, whose fingers are there."""
        end = self.state["end"]
        return np.where(end != 0, finger + end * self["gap_m"] / 2, self.state["motor"])

    @property
    def _inertia(self) -> tuple[np.ndarray, np.ndarray]:
        """Of the rotor, and of both together, ``(rows, motors)``."""
        return self.plant.rotor_inertia[self.rows], self.plant.inertia[self.rows]

    @property
    def _servo(self) -> tuple[np.ndarray, np.ndarray]:
        """Force per position and per velocity, ``(rows, motors)``."""
        gain, bias = (self.plant.field(f"actuator_{kind}")[self.rows] for kind in ("gainprm", "biasprm"))
        return gain[:, self.plant.actuators, 0], -bias[:, self.plant.actuators, 2]

    def _passed_on(self, velocity: np.ndarray) -> np.ndarray:
        """What motors passed on to their fingers in the last step if they moved as one, N, ``(rows, motors)``."""
        state, faster = self.state, velocity - self.state["before"]
        own = state["damping"] * velocity + (self._inertia[0] / self.dt + self._servo[1]) * faster
        given = self.plant.motor_force[self.rows] + state["push"] - own
        most, slides = state["friction"], np.abs(velocity) > _AT_REST_M_S
        return given - np.where(slides, np.sign(velocity) * most, np.clip(given, -most, most))

    def _speed_after(self, encoder: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Speed of motors after a step in which they move on their own, m/s, ``(rows, motors)``."""
        state, (rotor, _), (stiffness, servo_damping) = self.state, self._inertia, self._servo
        speed = state["speed"]
        force = np.clip(stiffness * (self._command - encoder) - servo_damping * speed, low, high)
        force += state["push"] - state["damping"] * speed
        speed = speed + self.dt * force / (rotor + self.dt * (servo_damping + state["damping"]))
        slowed = self.dt * state["friction"] / rotor
        return speed - np.clip(speed, -slowed, slowed)
