"""Is a gripper's description what its author meant? What follows from it, and what a grasp in its scene shows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from forcegrasp.doctor.finding import Finding, fine, mend, note, warning
from forcegrasp.errors import ConfigError, PhysicsError

if TYPE_CHECKING:
    import mujoco
    import numpy as np

    from forcegrasp.physics import Gripper
    from forcegrasp.physics.plant import Plant

# Two simulations of the same scene that differ by more than so many times the noise hide smaller effects.
_NOISE = 0.5
# Share by which a reading may differ from what presses: the paper's sensors add tangential forces, 2 % here.
_MISSED = 0.1
# Share by which one side's contacts may be stiffer than the other's; a set shows as much.
_UNLIKE = 0.03
# Share of the force that the largest command step is said to press with, which it must reach.
_REACHED = 0.5
# Share of their inertia that motors may get from the integrator.
_HEAVIER = 0.1
# Speed at which half of its dry friction may let an object creep, m/s: 0.1 mm in a second.
_CREEPS = 1e-4
# Share of a number of the scene by which a description's may differ: it is rounded.
_ROUNDED = 0.01
# Times the noise of the encoders by which a coupling may give way: an effect says where a real one does.
_GIVES_WAY = 1.0
# Times the noise of the encoders by which fingers may run into their end stops.
_INTO_A_STOP = 3.0
_PAGE = "see docs/your-gripper.md"


def check_gripper(name: str) -> Iterator[Finding]:
    """What a description says, in the user's units, and how it grasps.

    Args:
      name: of a gripper that comes with the package, or the path of a description.
    """
    from forcegrasp.physics import load_gripper

    try:
        gripper = load_gripper(name)
    except ConfigError as error:
        yield mend("description", str(error), _PAGE)
        return
    yield fine("description", f"{gripper.name}, {gripper.path}")
    yield from _motors(gripper)
    columns = [channel.column for channel in (*gripper.positions, *gripper.commands, *gripper.forces)]
    yield fine("columns", f"of a set's samples: {', '.join(columns)}")
    if gripper.is_servo:
        return
    yield from _sizes(gripper)
    yield from _nominals(gripper)
    try:
        yield from _grasp(gripper)
    except PhysicsError as error:
        yield mend("grasp", f"can't be simulated ({error})", "look at masses, gains and the time step of the scene")


def _motors(gripper: Gripper) -> Iterator[Finding]:
    import numpy as np

    unit, count = gripper.unit, len(gripper.motors)
    told = f"{count}, {gripper.stroke:g} {unit} from closed to open; a command every {1e3 * gripper.period_s:g} ms"
    if gripper.is_servo:
        yield fine("motors", told)
        return
    steps = gripper.stroke / gripper.max_step
    told += f", {gripper.max_step:g} {unit} at most, so that it closes in {steps * gripper.period_s:.2g} s"
    yield fine("motors", told)
    closed, opened = np.round(1e3 * gripper.opening.opening_at(np.array([0.0, gripper.stroke])), 1) + 0.0
    yield fine("opening", f"{opened:.1f} mm between the pads when open, and {closed:.1f} mm when closed")


def _sizes(gripper: Gripper) -> Iterator[Finding]:
    training, (small, large) = gripper.training, gripper.training.radius_m
    if not gripper.forces:
        yield note("forces", "none are read: positions alone are compared, and no policy can be trained")
    else:
        told = f"up to {training.max_force_n:.3g} N from the largest command step; noise {training.force_std_n:.2g} N"
        told += f", contact above {training.contact_threshold_n:.2g} N"
        if gripper.force == "motor":
            each = 1 / float(gripper.opening.travel.sum() / len(gripper.motors))
            told += f"; {each:.4g} N for each {gripper.effort_unit} of the motor's effort, wherever it is"
        yield fine("forces", told)
    soft = "" if training.softness else "; all as soft as the scene's, as training.softness is not there"
    yield fine("objects", f"radii of {1e3 * small:.3g} to {1e3 * large:.3g} mm are trained on{soft}")


def _nominals(gripper: Gripper) -> Iterator[Finding]:
    """Whether parameters start where the scene has them: fits begin at the one, trainings take the other."""
    import numpy as np

    from forcegrasp.physics.gripper_checks import compile_scene, scene_values

    model = compile_scene(gripper.model)
    for parameter in gripper.parameters.values():
        for write in parameter.writes:
            values = scene_values(gripper, model, write)
            column = "" if write.column is None else f" {write.column}"
            if len(values) and np.ptp(values) > _ROUNDED * abs(parameter.nominal) and not write.joint:
                told = f"{parameter.name} gives each joint the same {write.field}{column}, and {gripper.model.name} has"
                told += f" {' and '.join(dict.fromkeys(f'{value:g}' for value in values))}"
                own = f"{'-' if write.sign < 0 else ''}{write.field}@{gripper.motors[0].joint}{column}"
                yield warning("nominal", told, f"write one parameter for each motor, {own} and so on; {_PAGE}")
                break
            other = values[abs(values - parameter.nominal) > _ROUNDED * abs(parameter.nominal)]
            if len(other):
                told = f"{parameter.name} is {parameter.nominal:g}, and {gripper.model.name} has {other[0]:g}"
                told += f" ({write.field}{column}): fits start from the first, trainings take the other"
                yield warning("nominal", told, "give the scene's own value as nominal")
                break


def _grasp(gripper: Gripper) -> Iterator[Finding]:
    """Closes on an object in the middle and presses: who touches, and what sensors say of it."""
    import numpy as np

    from forcegrasp.physics.plant import Plant

    plant = Plant(gripper, 1, threads=1)
    place, force = _pressed(gripper, plant)
    radius = 1e3 * gripper.parameters["radius_m"].nominal
    pressed = _normal_forces(gripper, plant)
    untouched = [side for (side, _), newtons in zip(gripper.sides, pressed, strict=True) if not newtons > 0]
    if untouched:
        told = f"the {' and the '.join(untouched)} side does not touch an object of {radius:.3g} mm radius"
        yield mend("grasp", told, f"look where pads and object stand, and which way the joints close; {_PAGE}")
        return
    forces = " and ".join(f"{newtons:.3g}" for newtons in pressed)
    yield fine("grasp", f"an object of {radius:.3g} mm radius is pressed with {forces} N by full steps for 5 s")
    said = gripper.training.max_force_n
    if gripper.forces and pressed.mean() < _REACHED * said:
        told = f"training.max_force_n is {said:.3g} N, and full steps of {gripper.max_step:g} {gripper.unit} press"
        told += f" with {pressed.mean():.3g} N: goals beyond that are out of reach, and so are checks under such a load"
        yield warning("forces", told, f"make control.max_step larger, or leave max_force_n out; {_PAGE}")
    yield from _stiffness(plant, pressed)
    if gripper.force == "sensors":
        yield from _sensors(gripper, pressed, force[-1])
    if (apart := _apart(plant)) > _GIVES_WAY * gripper.training.position_std > 0:
        told = f"gives way by {1e3 * apart:.2g} m{gripper.unit} under this force, and no encoder tells"
        hard = 'solref="0.004 1" solimp="0.99 0.999 0.0001"'
        yield warning("coupling", told, f"make the scene's equality constraints hard: {hard}, {_PAGE}")
    if (deep := _into_a_stop(gripper, plant)) > _INTO_A_STOP * gripper.training.position_std:
        told = f"fingers that open at once run {1e3 * deep:.2g} m{gripper.unit} into the joints' range, which is soft"
        yield note("end stops", f"{told}; give joints the range that your gripper's own stops leave them, {_PAGE}")
    if (heavier := _heavier(plant)) > _HEAVIER:
        told = f"implicit steps of {1e3 * plant.dt:g} ms make motors {100 * heavier:.0f} % heavier than the scene says"
        yield note("time step", f"{told}; gains and forces that are fitted may be off by half as much, {_PAGE}")
    if (lighter := _lighter(plant)) > _HEAVIER:
        told = f"Euler's steps of {1e3 * plant.dt:g} ms make motors up to {100 * lighter:.0f} % lighter"
        yield note("time step", f'{told}, as kv acts by the speed at their start; take integrator="implicitfast"')
    if (speed := _creep(gripper, plant)) > _CREEPS:
        told = f"creeps by {1e3 * speed:.2g} mm a second under half of its frictionloss; dry friction would hold it"
        yield note("object", f"{told}; make it harder by solreffriction and solimpfriction, {_PAGE}")
    noise = np.array([gripper.training.position_std] * place.shape[1] + [gripper.training.force_std_n] * force.shape[1])
    other = np.concatenate(_pressed(gripper, Plant(gripper, 1, threads=1, other_collisions=True)), axis=1)
    if not noise.any():
        return  # nothing to hold differences against
    apart = (other - np.concatenate([place, force], axis=1))[:, noise > 0]
    differs = np.sqrt(np.mean((apart / noise[noise > 0]) ** 2))
    if differs > _NOISE:
        told = f"MuJoCo's two collision codes give grasps that are {differs:.2g} × the noise apart"
        yield warning("contacts", told, f"round the pads, or let them touch in one point; {_PAGE}")
    else:
        yield fine("contacts", f"both of MuJoCo's collision codes give the same grasp, to {differs:.2g} × the noise")


def _stiffness(plant: Plant, pressed: np.ndarray) -> Iterator[Finding]:
    """How stiff and how damped contacts are where each side presses with so many newtons, and whether alike."""
    import numpy as np

    deep = -plant.clearance(np.arange(1))[0].min(axis=1)
    if deep.min() <= 0:
        return
    stiff, unlike = pressed / deep, np.ptp(pressed / deep) > _UNLIKE * np.min(pressed / deep)
    depths = " and ".join(f"{1e3 * depth:.3g}" for depth in deep)
    told = " and ".join(f"{float(f'{newtons:.3g}'):g}" for newtons in (stiff if unlike else [stiff.mean()]))
    per_stiffness, impedance = _damping_and_impedance(plant)
    damping = f"damped by {stiff.mean() * per_stiffness:.3g} N·s/m, with an impedance of {impedance:.2g}"
    yield fine("stiffness", f"pads are {depths} mm in the object then: {told} N/m on each side, {damping}")
    if unlike:
        told = f"one object is {100 * (stiff.max() / stiff.min() - 1):.0f} % stiffer on one side than on the other"
        alike = "MuJoCo scales contacts by the inertia of what touches: make that of both sides' bodies alike"
        yield note("stiffness", f"{told}, which no real one is; {alike}, {_PAGE}")


def _sensors(gripper: Gripper, pressed: np.ndarray, read: np.ndarray) -> Iterator[Finding]:
    """Whether sensors feel what presses."""
    with_sensor = [index for index, (_, finger) in enumerate(gripper.sides) if finger.force_sensor]
    for index, newtons in zip(with_sensor, read, strict=True):
        side = gripper.sides[index][0]
        told = f"the {side} one reads {newtons:.3g} N where {pressed[index]:.3g} N press"
        if abs(newtons - pressed[index]) > _MISSED * pressed[index]:
            yield warning("sensors", told, f"look at its site or bodies, and its sign; {_PAGE}")
        else:
            yield fine("sensors", told)


def _damping_and_impedance(plant: Plant) -> tuple[float, float]:
    """Damping of the contacts with the object over their stiffness, s, and impedance, where the plant stands; means.

    MuJoCo's documentation, Computation, "Constraint model": a reference acceleration of −b v − k d r.
    """
    import numpy as np

    data = _as_it_stands(plant)
    pads, things = set(plant.pad_geoms.tolist()), set(plant.object_geoms.tolist())
    touching = [c.efc_address for c in data.contact if {*c.geom} & pads and {*c.geom} & things and c.efc_address >= 0]
    stiffness, damping, impedance, _ = data.efc_KBIP[touching].T
    return float(np.mean(damping / (stiffness * impedance))), float(np.mean(impedance))


def _as_it_stands(plant: Plant) -> mujoco.MjData:
    """The scene of the first row with its contacts and constraints where it stands."""
    import mujoco

    model, data = plant.batch.get_model(0), plant.batch.get_data(0)
    mujoco.mj_forward(model, data)
    return data


def _apart(plant: Plant) -> float:
    """By how much equality constraints are violated where the plant stands, m or rad; 0 if there are none."""
    import mujoco
    import numpy as np

    data = _as_it_stands(plant)
    of_couplings = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    return float(np.abs(data.efc_pos[of_couplings]).max(initial=0.0))


def _heavier(plant: Plant) -> float:
    """Largest share of a motor's inertia M that the integrator adds to it: h (k_v + damping) ÷ M.

    MuJoCo's documentation, Computation, "Numerical integration": implicit steps h solve with M − h ∂f/∂v for M.
    """
    import mujoco
    import numpy as np

    model = plant.model
    resists = plant.gearing**2 @ model.dof_damping
    if model.opt.integrator in (mujoco.mjtIntegrator.mjINT_IMPLICIT, mujoco.mjtIntegrator.mjINT_IMPLICITFAST):
        resists += _force_per_speed(plant)
    return float(np.max(plant.dt * resists / plant.inertia[0]))


def _lighter(plant: Plant) -> float:
    """Largest share of a motor's inertia M by which it seems lighter as Euler's steps h take its servo: h k_v ÷ M.

    The speed at a step's beginning is one step older than that at its end, with which implicit steps add as much.
    """
    import mujoco
    import numpy as np

    if plant.model.opt.integrator != mujoco.mjtIntegrator.mjINT_EULER:
        return 0.0
    return float(np.max(plant.dt * _force_per_speed(plant) / plant.inertia[0]))


def _force_per_speed(plant: Plant) -> np.ndarray:
    """What servos of joints give against their speed, N·s/m or N·m·s/rad, ``(motors,)``."""
    import mujoco
    import numpy as np

    model = plant.model
    of_joints = model.actuator_trntype[plant.actuators] == mujoco.mjtTrn.mjTRN_JOINT
    per_speed = -model.actuator_biasprm[plant.actuators, 2] * model.actuator_gear[plant.actuators, 0] ** 2
    return np.where(of_joints, per_speed, 0.0)


def _creep(gripper: Gripper, plant: Plant) -> float:
    """Speed at which the object creeps under half of its joint's ``frictionloss``, m/s; 0 if it has none.

    MuJoCo's documentation, Computation, "Constraint model": a₁ + d b v = (1 − d) a₀, with an impedance d and a damping
    b; a₁ = 0 once it creeps.
    """
    model = plant.model
    joint = model.joint(gripper.object_joint)
    dof = int(joint.dofadr[0])
    (constant, damping), (impedance, most, *_) = model.dof_solref[dof], model.dof_solimp[dof]
    pushed = 0.5 * model.dof_frictionloss[dof] * model.dof_invweight0[dof]
    by_speed = 2 / (most * max(constant, 2 * plant.dt)) if constant > 0 else -damping / most
    return float((1 - impedance) / impedance * pushed / by_speed)


def _into_a_stop(gripper: Gripper, plant: Plant) -> float:
    """How far motors run into the range of their joints when they open at once, m or rad; 0 if not at all."""
    import numpy as np

    deepest = 0.0
    for _ in range(round(2 / plant.dt)):
        plant.advance(np.full((1, plant.motors), gripper.stroke))
        deepest = max(deepest, float(np.max(plant.position[0] - gripper.motor_range[1])))
    return deepest


def _pressed(gripper: Gripper, plant: Plant) -> tuple[np.ndarray, np.ndarray]:
    """Closes by full steps; positions ``(steps, motors)`` and what is read of forces ``(steps, channels)``."""
    import numpy as np

    steps = max(1, round(gripper.period_s / plant.dt))
    plant.reset(np.arange(1), offset_m=np.zeros(1))
    place, force = [], []
    for _ in range(round(5 / gripper.period_s)):
        command = np.clip(plant.measured_position - gripper.max_step, 0, gripper.stroke)
        plant.advance(command, steps)
        place.append(plant.measured_position[0].copy())
        force.append(plant.measured_force[0].copy())
    if plant.warnings().any():
        raise PhysicsError("it diverged")
    return np.array(place), np.array(force)


def _normal_forces(gripper: Gripper, plant: Plant) -> np.ndarray:
    """What each side presses with as the engine has it, whatever sensors say, newtons, ``(2,)``."""
    import mujoco
    import numpy as np

    model, data = plant.batch.get_model(0), _as_it_stands(plant)
    bodies, found, of_contact = [model.body(finger.body).id for finger in gripper.fingers], np.zeros(2), np.zeros(6)
    for index, contact in enumerate(data.contact):
        geoms = set(contact.geom.tolist())
        if not geoms & set(plant.object_geoms.tolist()):
            continue
        mujoco.mj_contactForce(model, data, index, of_contact)
        for geom in geoms - set(plant.object_geoms.tolist()):
            body = model.geom_bodyid[geom]
            while body and body not in bodies:
                body = model.body_parentid[body]
            if body in bodies:
                found[bodies.index(body)] += of_contact[0]
    return found
