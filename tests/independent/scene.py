"""TIAGo's two fingers around a cylinder, in MuJoCo, one compiled model per grasp."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch

STEP_S = 0.0005
SAMPLE_S = 0.04
OPEN_M = 0.045
MOTOR_LIMIT_N = 1.0
FINGER_KG, ROTOR_KG, GUIDE_DAMPING = 0.10998, 0.1, 1.0

_MAX_CONTACTS = 40  # per finger: multiccd finds several points per pair

_SCENE = """
<mujoco>
  <option timestep="{step}" integrator="implicitfast" solver="Newton" cone="pyramidal" impratio="1"
          iterations="100" tolerance="1e-8" ls_iterations="50" ls_tolerance="0.01">
    <flag multiccd="{multiccd}"/>
  </option>
  <worldbody>
    <geom name="table" type="plane" size="1 1 0.1"/>
    <body name="object" pos="0 {offset} 0.05">
      <freejoint/>
      <geom type="cylinder" size="{radius} 0.05" mass="{mass}" condim="3" friction="{friction} 0.005 0.0001"
            priority="1" solref="{solref}" solimp="{least} 0.99 {rho} 0.5 2"/>
    </body>
    {left}
    {right}
  </worldbody>
  <contact><exclude body1="left" body2="right"/></contact>
  <actuator>{motors}</actuator>
  <sensor>
    <contact name="left" body1="object" body2="left" num="{contacts}" data="force" reduce="none"/>
    <contact name="right" body1="object" body2="right" num="{contacts}" data="force" reduce="none"/>
  </sensor>
</mujoco>
"""

# The joint's anchor is off the body's origin so that MuJoCo does not take the body for a "simple" one, whose inverse
# weight would forget the armature.
_FINGER = """
<body name="{name}" pos="0 0 0.05">
  <inertial pos="0 0 0" mass="0.10998" diaginertia="0.000161667 0.000161667 0.000161667"/>
  <joint name="{name}" type="slide" axis="0 {side} 0" pos="0 0 0.01" limited="true" range="0 0.045"
         armature="{armature}" damping="1" solreflimit="0.02 1" solimplimit="0.9 0.95 0.001"/>
  {pads}
</body>
"""

_MOTOR = """
<general joint="{name}" biastype="affine" gainprm="{gain}" biasprm="0 -{gain} {b2}"
         ctrllimited="true" ctrlrange="0 0.045" forcelimited="true" forcerange="-{limit} {limit}"/>
"""

# x, distance of the centre from the joint's position, z; half sizes. The four small ones touch first, at that position.
_PADS = [((0.002, 0.0033, 0.0), (0.017, 0.003, 0.017))] + [
    ((x, 0.003, z), (0.0085, 0.003, 0.0085)) for x in (-0.0065, 0.0105) for z in (0.0085, -0.0085)
]


@dataclass(frozen=True)
class Servo:
    """The position servo of a finger's motor."""

    gain: float = 100.0
    b2: float = -9.0
    limit: float = MOTOR_LIMIT_N

    def force(self, setpoint: np.ndarray, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.clip(self.gain * (setpoint - q) + self.b2 * v, -self.limit, self.limit)


def compile_model(
    rho: float,
    radius: float,
    offset: float,
    servo: Servo | None = None,
    multiccd: bool = False,
    friction: float = 1.0,
    solref: str = "0.02 1",
    mass: float = 0.4,
    least: float = 0.0,
) -> mujoco.MjModel:
    """One grasp's model. Without a servo, the motor (and its rotor's inertia) is simulated outside MuJoCo.

    MuJoCo's own convex collision code either way. ``multiccd`` gives each pair of shapes several contact points: the
    same object is then stiffer, by some 70 µm of squeeze.
    """

    def finger(name: str, side: int) -> str:
        pads = [
            '<geom type="box" pos="{} {} {}" size="{} {} {}"/>'.format(x, side * y, z, *half)
            for (x, y, z), half in _PADS
        ]
        armature = ROTOR_KG if servo else 0.0
        return _FINGER.format(name=name, side=side, armature=armature, pads="\n  ".join(pads))

    motors = ""
    if servo:
        motors = "".join(
            _MOTOR.format(name=name, gain=servo.gain, b2=servo.b2, limit=servo.limit) for name in ("left", "right")
        )
    xml = _SCENE.format(
        step=STEP_S, offset=offset, radius=radius, rho=rho, contacts=_MAX_CONTACTS, motors=motors,
        multiccd="enable" if multiccd else "disable", friction=friction, solref=solref, mass=mass, least=least,
        left=finger("left", -1), right=finger("right", 1),
    )  # fmt: skip
    model = mujoco.MjModel.from_xml_string(xml)
    if servo is None:
        # A contact's softness is scaled by these: the object stays the same whatever hangs behind the pad.
        whole = compile_model(rho, radius, offset, Servo(), friction=friction, solref=solref, mass=mass, least=least)
        model.body_invweight0[:], model.dof_invweight0[:] = whole.body_invweight0, whole.dof_invweight0
    return model


class MujocoPlant:
    """Fingers and objects of ``n`` grasps; everything per finger is ``(n, 2)``, left first, positive opens.

    Args:
      rho, radius, offset: of each grasp's object, ``(n,)``.
      servo: the fingers' servo, or None when the caller simulates the motors.
      multiccd: see :func:`compile_model`.
      friction: of the object, on the table and on the pads.
      solref: time constant and damping ratio of what touches the object.
      mass: of the object, kg.
      least: impedance of what touches the object at no depth.
    """

    def __init__(
        self,
        rho: np.ndarray,
        radius: np.ndarray,
        offset: np.ndarray,
        servo: Servo | None,
        multiccd: bool = False,
        friction: float = 1.0,
        solref: str = "0.02 1",
        mass: float = 0.4,
        least: float = 0.0,
    ) -> None:
        _silence_log()
        objects = zip(rho, radius, offset, strict=True)
        models = [compile_model(*values, servo, multiccd, friction, solref, mass, least) for values in objects]
        self._batch = batch = Batch(models[0], len(models), 1)
        batch.set_models(models)
        batch.reset()
        self._qpos, self._qvel = batch.bind("qpos"), batch.bind("qvel")
        self._applied, self._sensors = batch.bind("qfrc_applied"), batch.bind("sensordata")
        self._constraint = batch.bind("qfrc_constraint")
        self._ctrl = batch.bind("ctrl") if servo else None
        self._qpos[:, 7:9] = OPEN_M
        batch.forward()
        self._read(np.zeros((len(models), 2)))

    def step(self, setpoint: np.ndarray, finger: np.ndarray, press: np.ndarray, table: np.ndarray) -> None:
        """One physics step.

        Args:
          setpoint: of the servos.
          finger: further force on each finger.
          press: further force between each pad and the object, positive presses.
          table: further force on the object along y, ``(n,)``.
        """
        if self._ctrl is not None:
            self._ctrl[:] = setpoint
        self._applied[:, 6:8] = finger + press
        self._applied[:, 1] = press[:, 0] - press[:, 1] + table
        self._batch.step(nstep=1)
        self._read(press)

    def _read(self, press: np.ndarray) -> None:
        self.q, self.v = self._qpos[:, 7:9].copy(), self._qvel[:, 6:8].copy()
        self.o, self.ov = self._qpos[:, 1].copy(), self._qvel[:, 1].copy()
        #: what the tactile sensor feels (normal and both signed tangents, as the authors sum them)
        self.touch = self._sensors.reshape(len(self.q), 2, -1).sum(axis=-1) + press
        #: what pushes a finger open
        self.load = self._constraint[:, 6:8] + press

    def check(self) -> None:
        """Raises if a grasp diverged: MuJoCo resets bad states silently."""
        if np.any(self._batch.warning[..., 1]) or not np.all(np.isfinite(self.q)):
            raise FloatingPointError("a grasp diverged")


def _silence_log() -> None:
    log = mujoco.MjLogConfig.get()
    log.logto_file = log.logto_console = False
    log.set()
