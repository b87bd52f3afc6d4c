"""Descriptions of grippers: what they mean in the simulated plant, and what is wrong with broken ones."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yaml

from forcegrasp.errors import ConfigError
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant, write_base

SECOND = Path(__file__).parents[1] / "grippers" / "second.yaml"
GRIPPERS = ("tiago", str(SECOND))
OBJECTS = {
    "box": ("box", "0.02 0.03 0.03"),
    "cylinder": ("cylinder", "0.02 0.03"),
    "sphere": ("sphere", "0.02"),
}
RAIL = '<joint name="rail" type="slide" axis="1 0 0" damping="2" frictionloss="0.1"/>'


def _copy(folder: Path, description: dict | None = None, swap: dict[str, str] | None = None) -> Path:
    """Writes the second gripper, or another description of it, with text of its MJCF swapped; returns its path."""
    scene = SECOND.with_suffix(".xml").read_text()
    for old, new in (swap or {}).items():
        assert old in scene
        scene = scene.replace(old, new)
    (folder / "second.xml").write_text(scene)
    path = folder / "second.yaml"
    path.write_text(SECOND.read_text() if description is None else yaml.safe_dump(description))
    return path


def _object(kind: str, radius: float | None = None) -> dict[str, str]:
    shape, size = OBJECTS[kind]
    if radius is not None:
        size = " ".join([repr(radius), *size.split()[1:]])
    return {'type="box" size="0.02 0.03 0.03"': f'type="{shape}" size="{size}"'}


def _plant(gripper: Gripper, n: int, tier: str = "reference", **base: list[float]) -> Plant:
    """Open fingers around objects of these base parameters."""
    plant, ids = Plant(gripper, n, tier, threads=1), np.arange(n)
    offset = write_base(plant, ids, {name: np.array(values) for name, values in base.items()})
    plant.reset(ids, offset, np.full((n, 2), gripper.stroke))
    return plant


def _close(plant: Plant, seconds: float = 1.0) -> np.ndarray:
    """Closes fully; returns positions, forces and the object's position over time, ``(steps, n, 5)``."""
    seen = []
    for _ in range(round(seconds / plant.dt / 10)):
        plant.advance(np.zeros((plant.n, 2)), 10)
        seen.append(np.concatenate([plant.position, plant.force, plant.object_position[:, None]], axis=1))
    assert not plant.warnings().any()
    return np.stack(seen)


@pytest.mark.parametrize("name", GRIPPERS)
def test_closes_on_the_object_with_sane_forces(name):
    gripper = load_gripper(name)
    plant = _plant(gripper, 1)
    assert plant.position[0] == pytest.approx([gripper.stroke] * 2)
    start = plant.velocity.copy()
    seen = _close(plant, 0.04)
    assert (start == 0).all()
    assert (plant.velocity < 0).all()
    assert (seen[-1, 0, :2] < gripper.stroke - 1e-5).all()
    seen = _close(plant, 4.0)
    radius = gripper.parameters["radius_m"].nominal
    assert seen[-1, 0, :2] == pytest.approx([radius] * 2, abs=0.006)
    assert (seen[-1, 0, 2:4] > 0.2).all()
    assert (seen[-1, 0, 2:4] < 20).all()


@pytest.mark.parametrize("name", GRIPPERS)
def test_command_holds_where_it_says(name):
    gripper = load_gripper(name)
    plant = _plant(gripper, 1)
    command = np.array([[0.030, 0.038]])
    plant.advance(command, round(4 / plant.dt))
    assert plant.position == pytest.approx(command, abs=3e-4)  # the second one's drives rub a little


@pytest.mark.parametrize("name", GRIPPERS)
def test_positive_offset_is_towards_the_right_finger(name):
    plant = _plant(load_gripper(name), 3, offset_m=[0.0, 0.004, -0.004])
    assert plant.object_position == pytest.approx([0, 0.004, -0.004], abs=1e-9)
    touching = _close(plant, 4.0)[:, :, 2:4] > 0.01
    left, right = np.moveaxis(touching.argmax(axis=0), -1, 0)
    assert touching.any(axis=0).all()
    assert right[1] < left[1]
    assert left[2] < right[2]


@pytest.mark.parametrize("free", [False, True], ids=["slide", "free"])
@pytest.mark.parametrize("kind", OBJECTS)
@pytest.mark.parametrize("tier", ["reference", "fast"])
def test_radius_writes_are_the_compilers(tmp_path, kind, free, tier):
    """To the last bit: model and rollout of a scene that had that radius from the start."""
    swap = {RAIL: '<freejoint name="rail"/>', "<option": '<option gravity="0 0 0"'} if free else {}
    description = yaml.safe_load(SECOND.read_text()) | {"fast": "sphere"}
    radius = 0.027123456789
    (tmp_path / "compiled").mkdir()
    scene = _copy(tmp_path, description, swap | _object(kind))
    written = _plant(load_gripper(str(scene)), 2, tier, radius_m=[0.02, radius])
    scene = _copy(tmp_path / "compiled", description, swap | _object(kind, radius))
    compiled = _plant(load_gripper(str(scene)), 1, tier)
    for plant in (written, compiled):
        plant.write_radius(np.arange(plant.n), np.array([0.02, radius][-plant.n :]))
        plant.reset(np.arange(plant.n), np.zeros(plant.n))
    one, other = written.batch.get_model(1), compiled.batch.get_model(0)
    names = [name for name in dir(other) if isinstance(getattr(other, name), np.ndarray)]
    assert {"body_inertia", "geom_size", "geom_rbound", "geom_aabb", "body_invweight0"} <= {*names}
    assert [name for name in names if not np.array_equal(getattr(one, name), getattr(other, name))] == []
    assert not np.array_equal(written.batch.get_model(0).geom_size, other.geom_size)
    np.testing.assert_array_equal(_close(written)[:, 1], _close(compiled)[:, 0])


@pytest.mark.parametrize("names", [("radius_m", "mass_kg"), ("mass_kg", "radius_m")])
def test_mass_is_as_if_the_scene_had_been_compiled_with_it(tmp_path, names):
    """Whichever is written first; an effect on their radii keeps it, and what is not given is the scene's."""
    values = {"radius_m": np.array([0.02, 0.025]), "mass_kg": np.array([np.nan, 0.9])}
    plant, ids = Plant(load_gripper(str(_copy(tmp_path))), 2, threads=1), np.arange(2)
    for _ in range(2):  # to write it again changes nothing
        write_base(plant, ids, {name: values[name] for name in names})
    plant.reset(ids, np.zeros(2))
    scene = (tmp_path / "second.xml").read_text()
    mass = plant.model.body_mass[plant.model.body("thing").id]
    assert f'mass="{mass:g}"' in scene
    (tmp_path / "other").mkdir()
    swap = {f'mass="{mass:g}"': 'mass="0.9"', "0.02 0.03 0.03": "0.025 0.03 0.03"}
    other = Plant(load_gripper(str(_copy(tmp_path / "other", swap=swap))), 1, threads=1)
    other.reset(np.arange(1), np.zeros(1))
    heavy, compiled = plant.batch.get_model(1), other.batch.get_model(0)
    for name in ("body_mass", "body_inertia", "body_invweight0", "dof_M0"):
        np.testing.assert_allclose(getattr(heavy, name), getattr(compiled, name), rtol=1e-12)
    assert plant.batch.get_model(0).body_mass[plant.model.body("thing").id] == mass
    plant.change_radius(ids, np.array([0.0, 0.005]))
    plant.derive_fields(ids)
    light, heavy = (plant.batch.get_model(i).body_inertia[plant.model.body("thing").id, 0] for i in ids)
    assert heavy / light == pytest.approx(0.9 / mass)  # about the axis of the grasp


def test_radius_leaves_an_inertia_of_its_own_alone(tmp_path):
    own = '<inertial pos="0 0 0" mass="0.6" diaginertia="1e-3 2e-3 2.5e-3"/>'
    gripper = load_gripper(str(_copy(tmp_path, swap={RAIL: own + RAIL})))
    plant = _plant(gripper, 2, radius_m=[0.02, 0.03])
    body = plant.model.body("thing").id
    np.testing.assert_array_equal(plant.batch.get_model(1).body_inertia[body], [1e-3, 2e-3, 2.5e-3])


def test_object_may_stand_anywhere_in_the_world(tmp_path):
    """With a free joint, too, an offset counts from where the scene puts the object."""
    free = {RAIL: '<freejoint name="rail"/>', "<option": '<option gravity="0 0 0"'}
    plant = _plant(load_gripper(str(_copy(tmp_path, swap=free))), 1, offset_m=[0.005])
    assert plant.object_position == pytest.approx([0.005], abs=1e-12)
    assert _close(plant, 3.0)[-1, 0] == pytest.approx([0.018, 0.018, 4.5, 4.5, 0], abs=0.1)


@pytest.mark.parametrize("name", GRIPPERS)
def test_every_base_parameter_changes_a_rollout(name):
    gripper = load_gripper(name)
    names = list(gripper.parameters)
    base = {key: np.full(1 + len(names), gripper.parameters[key].nominal) for key in names}
    for row, key in enumerate(names, start=1):
        parameter = gripper.parameters[key]
        base[key][row] = parameter.nominal + 0.2 * (parameter.high - parameter.nominal)
    seen = _close(_plant(gripper, 1 + len(names), **base), 3.0)
    alone = _close(_plant(gripper, 1, **{key: values[:1] for key, values in base.items()}), 3.0)
    np.testing.assert_array_equal(alone[:, 0], seen[:, 0])
    assert [key for row, key in enumerate(names, 1) if np.array_equal(seen[:, row], seen[:, 0])] == []


@pytest.mark.parametrize("name", GRIPPERS)
def test_nominal_values_are_the_scenes(name):
    gripper = load_gripper(name)
    nominal = {key: [p.nominal] for key, p in gripper.parameters.items() if key != "force_scale"}
    np.testing.assert_array_equal(_close(_plant(gripper, 1, **nominal), 3.0), _close(_plant(gripper, 1), 3.0))


def test_writes_go_to_their_columns_with_their_sign():
    plant = _plant(load_gripper(str(SECOND)), 2, servo_stiffness=[300, 400], joint_damping=[30, 50])
    model = plant.batch.get_model(1)
    assert model.actuator_gainprm[:, 0].tolist() == [400, 400]
    assert model.actuator_biasprm[:, :3].tolist() == [[0, -400, -20]] * 2
    assert model.dof_damping.tolist() == [2, 50, 50]


def test_descriptions_are_read_afresh(tmp_path):
    path = _copy(tmp_path)
    load_gripper("second.yaml", tmp_path)
    _copy(tmp_path, swap={'name="drive_west"': 'name="drive"'})
    with pytest.raises(ConfigError, match="has no 'drive_west'; did you mean"):
        load_gripper(str(path))


# --- broken descriptions ----------------------------------------------------------------------------------------------

_DAMPING = "parameters.joint_damping"

#: key, its new value (``...`` removes it), what the message must name
BROKEN_VALUES = [
    *((key, ..., f"{key}: missing") for key in ("format", "name", "model", "fingers", "object", "parameters")),
    *((f"fingers.{key}", ..., f"fingers.{key}: missing") for key in ("joints", "actuators", "closed", "open")),
    ("object.axis", ..., "object.axis: missing"),
    (f"{_DAMPING}.unit", ..., f"{_DAMPING}.unit: missing"),
    ("parameters.radius_m", ..., "parameters.radius_m: missing"),
    ("modle", "second.xml", "modle: unknown; did you mean model"),
    ("fingers.opened", 0.05, "fingers.opened: unknown"),
    ("object.shape", "box", "object.shape: unknown"),
    (f"{_DAMPING}.min", 1, f"{_DAMPING}.min: unknown"),
    ("format", "forcegrasp-gripper/9", "format: must be forcegrasp-gripper/2; forcegrasp-gripper/1 is read, too"),
    ("name", 7, "name: must be text, not 7; put it in quotes"),
    ("name", ["a"], "name: must be text, not ['a']"),
    ("model", None, "model: must be text, not None"),
    ("model", "nowhere.xml", "nowhere.xml: could not read the scene"),
    ("model", "second.yaml", "not XML"),
    ("fast", "cube", "fast: must be none or sphere"),
    ("fingers", ["west", "east"], "fingers: must map"),
    ("object", "thing", "object: must map"),
    ("parameters", [], "parameters: must be a mapping"),
    ("fingers.joints", "west", "fingers.joints: must be two names"),
    ("fingers.joints", ["west", "east", "north"], "fingers.joints: must be two names"),
    ("fingers.joints", ["west", "west"], "fingers.joints: must be two names"),
    ("fingers.joints", ["west", 3], "fingers.joints[1]: must be text, not 3"),
    ("fingers.joints", ["west", "easst"], "fingers.joints: second.xml has no 'easst'; did you mean east"),
    ("fingers.joints", ["west", "rail"], "fingers.joints: 'rail' must open towards +x, as the right finger"),
    ("fingers.joints", ["east", "west"], "fingers.joints: 'east' must open towards -x, as the left finger"),
    ("fingers.actuators", ["drive_west", "drive_est"], "fingers.actuators: second.xml has no 'drive_est'"),
    ("fingers.actuators", ["drive_east", "drive_west"], "fingers.actuators: 'drive_east' must drive the left finger"),
    ("fingers.force_sensors", ["touch_west", "touch"], "fingers.force_sensors: second.xml has no 'touch'"),
    ("fingers.closed", "0.05 m", "fingers.closed: must be a number, not 0.05 m"),
    ("fingers.closed", "5e-2", "fingers.closed: must be a number, not 5e-2; YAML wants 1.0e-3 for 1e-3"),
    ("fingers.closed", True, "fingers.closed: must be a number, not True"),
    ("fingers.closed", float("nan"), "fingers.closed: must be a number, not nan"),
    ("fingers.closed", 10**400, "must be a number"),
    ("fingers.closed", 0.0, "fingers.open: must differ from closed"),
    ("fingers.closed", 50, "fingers.closed=50: the left joint goes from 0 to 0.05 m"),
    ("fingers.closed", -0.05, "fingers.joints: 'west' must open towards -x"),
    ("object.axis", "w", "object.axis: must be x, y or z"),
    ("object.axis", ["x"], "object.axis: must be x, y or z"),
    ("object.axis", "y", "fingers.joints: 'west' must open towards -y"),
    ("object.joint", "thing", "object.joint: second.xml has no 'thing'"),
    ("object.joint", "west", "object.geom: 'thing' must be on the body that 'west' moves"),
    ("object.joint", "east", "object.joint: 'east' must be a free joint, or a slide joint towards +x"),
    ("object.geom", "things", "object.geom: second.xml has no 'things'; did you mean thing"),
    ("object.geom", "west", "object.geom: 'west' must be on the body that 'rail' moves"),
    (_DAMPING, 40, f"{_DAMPING}: must map"),
    (f"{_DAMPING}.nominal", 500, f"{_DAMPING}.nominal: 500 must lie between low=10 and high=120"),
    (f"{_DAMPING}.low", "ten", f"{_DAMPING}.low: must be a number, not ten"),
    (f"{_DAMPING}.high", None, f"{_DAMPING}.high: must be a number, not None"),
    (f"{_DAMPING}.unit", 3, f"{_DAMPING}.unit: must be text, not 3"),
    (f"{_DAMPING}.scope", "finger", f"{_DAMPING}.scope: must be gripper, object, recording or grasp, not finger"),
    (f"{_DAMPING}.writes", [], f"{_DAMPING}.writes: must name a field"),
    (f"{_DAMPING}.writes", "dof_damping", f"{_DAMPING}.writes: must be a list, such as `[dof_damping]`"),
    (f"{_DAMPING}.writes", 3, f"{_DAMPING}.writes: must be a list"),
    (f"{_DAMPING}.writes", ["damping"], f"{_DAMPING}.writes[0]: 'damping' must look like"),
    (f"{_DAMPING}.writes", ["dof_damping x"], f"{_DAMPING}.writes[0]: 'dof_damping x' must look like"),
    (f"{_DAMPING}.writes", [{"dof_damping": 0}], "must look like"),
    (f"{_DAMPING}.writes", ["tendon_damping"], "'tendon_damping' must look like"),
    (f"{_DAMPING}.writes", ["dof_dampin"], "in MuJoCo's model; did you mean dof_damping"),
    (f"{_DAMPING}.writes", ["geom_type"], "geom_type is no field of numbers"),
    (f"{_DAMPING}.writes", ["dof_damping 0"], "dof_damping needs no column"),
    (
        f"{_DAMPING}.writes",
        ["-dof_damping"],
        "dof_damping is 40 in second.xml, and joint_damping would make it -40: write",
    ),
    (
        "parameters.contact_stiffness.writes",
        ["geom_solref 0"],
        "geom_solref 0 is -900 in second.xml, and contact_stiffness would make it 900: write -geom_solref 0",
    ),
    (f"{_DAMPING}.writes", ["geom_solimp"], "geom_solimp needs a column from 0 to 4"),
    (f"{_DAMPING}.writes", ["geom_solimp 5"], "geom_solimp needs a column from 0 to 4"),
    (f"{_DAMPING}.writes", ["dof_damping@wrist"], "dof_damping@wrist: is no motor's joint"),
    (f"{_DAMPING}.writes", ["geom_solref@west 0"], "geometries are the object's, of no joint; leave @west out"),
    ("parameters.radius_m.writes", ["geom_size 0"], "parameters.radius_m.writes: must be []"),
    ("parameters.radius_m.low", -0.01, "parameters.radius_m.low: must be positive"),
]


def _refusal(path: Path) -> str:
    with pytest.raises(ConfigError) as caught:
        load_gripper(str(path))
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(str(path.parent))
    assert len(message) < len(str(path)) + 400
    return message


@pytest.mark.parametrize(("key", "value", "expected"), BROKEN_VALUES)
def test_broken_value_is_one_line_with_file_and_key(tmp_path, key, value, expected):
    description = yaml.safe_load(SECOND.read_text())
    *parents, last = key.split(".")
    place = description
    for parent in parents:
        place = place[parent]
    if value is ...:
        del place[last]
    else:
        place[last] = value
    assert expected in _refusal(_copy(tmp_path, description))


#: The same for the shipped descriptions of the second format.
BROKEN_SECOND = [
    ("motors", ..., "motors: missing, such as `[{joint: j, actuator: a, closed: 0, open: 0.04}]`"),
    ("motors", {}, "motors: must be a list of one motor, or of two (left, right)"),
    ("motors.0.open", "wide", "motors[0].open: must be a number, not wide"),
    ("motors.0.joints", "a", "motors[0].joints: unknown; did you mean joint"),
    ("fingers.left.body", "pad", "fingers.left: needs the joint that moves it, or the body of its pads"),
    ("force", "effort", "force: must be sensors, motor or none, not effort"),
    ("force", "motor", "force: motor: `sensors` needs a finger with a force_sensor, the others need none"),
    ("control.period_s", 0, "control.period_s: must be positive"),
    ("scale.force", True, "scale.force: must be a number, not True"),
    ("training.radius_m", [0.03, 0.02], "training.radius_m: must be [low, high] with low ≤ high"),
    ("training.radius_m", 0.03, "training.radius_m: must be two numbers in brackets"),
    ("training.radius", [0.02, 0.03], "training.radius: unknown; did you mean radius_m"),
    ("training.softness.width", [1, 2], "training.softness: no parameter 'width'"),
    ("training.servo_gain", "gain", "training.servo_gain: no parameter 'gain'"),
    ("training.servo_gain", ..., "training.servo_gain: missing; a training draws the gain of `servo_gain` from"),
    ("training.servo_gain_range", ..., "training.servo_gain_range: missing"),
]


@pytest.mark.parametrize(("key", "value", "expected"), BROKEN_SECOND)
def test_broken_value_of_the_second_format(tmp_path, key, value, expected):
    shipped = load_gripper("tiago").path
    description = yaml.safe_load(shipped.read_text())
    *parents, last = key.split(".")
    place = description
    for parent in parents:
        place = place[int(parent)] if isinstance(place, list) else place[parent]
    if value is ...:
        del place[last]
    else:
        place[last] = value
    (tmp_path / "tiago.xml").write_text(shipped.with_suffix(".xml").read_text())
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(description))
    assert expected in _refusal(path)


def test_closed_and_open_swapped_of_one_motor_is_told(tmp_path):
    shipped = load_gripper("robotiq_2f85").path
    (tmp_path / "robotiq_2f85.xml").write_text(shipped.with_suffix(".xml").read_text())
    description = yaml.safe_load(shipped.read_text())
    description["motors"][0] |= {"closed": 0.0, "open": 0.8}
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(description))
    assert "from open to closed; they go apart: are closed and open swapped?" in _refusal(path)


def test_several_wrong_keys_are_told_at_once(tmp_path):
    (tmp_path / "second.yaml").write_text("format: forcegrasp-gripper/2\nname: 7\nmodle: a.xml\n")
    message = _refusal(tmp_path / "second.yaml")
    assert "second.yaml: modle: unknown; did you mean model?; also name: must be text, not 7" in message
    assert "also model: missing" in message
    assert message.endswith("more")


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "the file: must map"),
        (b"- a\n- b\n", "the file: must map"),
        (b"just text", "the file: must map"),
        (b"fingers: {joints: [a, b\nobject: 3", "row 2"),
        (b"a: b: c", "mapping values are not allowed"),
        (b"name: !!python/object/apply:os.system ['true']", "the tag"),
        (b"a: 1\n---\nb: 2", "expected a single document"),
        (b"? [1, 2]\n: x", "a key must be text"),
        (b"name: 2020-13-45", "month must be in 1..12"),
        (b"\x89PNG\r\n\x1a\n\x00\xff", "could not read the gripper description"),
        ("name: ä".encode("utf-16"), "could not read the gripper description"),
        (b"[" * 5000, "nested too deeply"),
    ],
)
def test_broken_file_is_one_line(tmp_path, content, expected):
    path = tmp_path / "second.yaml"
    path.write_bytes(content)
    assert expected in _refusal(path)


WEST = '<joint name="west"/>'
TOUCH = '<touch name="touch_east" site="east"/>'


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("</mujoco>", "", "not XML"),
        ("<mujoco", "\x00\x01", "not XML"),
        ('axis="1 0 0" range', 'axis="0 0 0" range', "MuJoCo refuses it"),
        (
            WEST,
            '<joint name="west" type="hinge"/>',
            "fingers.closed=0.05: the left joint goes from 0 to 0.000872665 rad",
        ),
        (WEST, '<joint name="west" axis="0 0 1"/>', "fingers.joints: 'west' must open towards -x"),
        (WEST, '<joint name="west" axis="-1 0 0"/>', "fingers.joints: 'west' must open towards -x"),
        (WEST, '<joint name="west" range="0 0.04"/>', "fingers.closed=0.05: the left joint goes from 0 to 0.04 m"),
        ('ctrlrange="0 0.05"', 'ctrlrange="0.01 0.05"', "fingers.open=0: the left actuator goes from 0.01 to 0.05 m"),
        ('name="drive_east" joint="east"', 'name="drive_east" joint="west"', "'drive_east' must drive the right"),
        ('<position class="finger" name="drive_east"', '<motor name="drive_east"', "must be a position servo"),
        ('name="drive_east"', 'name="drive_east" gear="50"', "must be a position servo"),
        (TOUCH, '<jointpos name="touch_east" joint="east"/>', "must be a touch sensor"),
        (TOUCH, '<force name="touch_east" site="east"/>', "must be a touch sensor"),
        (
            TOUCH,
            '<contact name="touch_east" geom1="thing" geom2="east" num="1" data="force" reduce="netforce"/>',
            "fingers.force_sensors: 'touch_east' must be a touch sensor, or a contact sensor with data='force'",
        ),
        (RAIL, RAIL.replace("1 0 0", "-1 0 0"), "'rail' must be a free joint, or a slide joint towards +x"),
        (RAIL, RAIL.replace("slide", "ball"), "object.joint: 'rail' must be a free joint"),
        ('type="box" size="0.02 0.03 0.03"', 'type="capsule" size="0.02 0.03"', "'thing' must be a cylinder, a sphere"),
    ],
)
def test_broken_scene_is_one_line(tmp_path, old, new, expected):
    assert expected in _refusal(_copy(tmp_path, swap={old: new}))


def test_fast_tier_that_does_not_compile_is_refused(tmp_path):
    description = yaml.safe_load(SECOND.read_text()) | {"fast": "sphere"}
    swap = {'<geom name="west"/>': '<geom name="thing_pads"/>'}
    assert "MuJoCo refuses it" in _refusal(_copy(tmp_path, description, swap))


def test_a_folder_is_no_description(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _folder(tmp_path / "mine")
    with pytest.raises(ConfigError, match=r"gripper=mine: a folder; give the description in it, such as mine/"):
        load_gripper("mine")


def test_missing_description(tmp_path):
    assert "No such file" in _refusal(tmp_path / "second.yaml")
    assert "Is a directory" in _refusal(_folder(tmp_path / "folder.yaml"))
    with pytest.raises(ConfigError, match=r"gripper=tiaga: no such gripper; did you mean tiago\?; or give"):
        load_gripper("tiaga")
    for name in ("virtual_robot", "paper_objects"):  # models and objects lie beside the grippers and are none
        known = "franka_hand, robotiq_2f85, so101_gripper, tiago"
        with pytest.raises(ConfigError, match=rf"gripper={name}: no such gripper; known: {known}; or give"):
            load_gripper(name)


def _folder(path: Path) -> Path:
    path.mkdir()
    return path


def test_there_are_many_kinds_of_mistakes():
    assert len({re.sub(r"=.*?:", "", expected) for *_, expected in BROKEN_VALUES}) >= 40


def test_contact_sensor_reads_as_a_touch_sensor_does(tmp_path):
    """A contact's force in its own axes: the normal comes first and is positive, whichever body is named first."""
    sensors = {
        f'<touch name="touch_{side}" site="{side}"/>': f'<contact name="touch_{side}" body{1 + flip}="thing"'
        f' body{2 - flip}="{side}" num="8" data="force"/>'
        for flip, side in enumerate(("west", "east"))
    }
    other = _close(_plant(load_gripper(str(_copy(tmp_path, swap=sensors))), 1))
    np.testing.assert_allclose(other, _close(_plant(load_gripper(str(SECOND)), 1)), atol=1e-6)


def test_mjcf_shortcuts_are_undone_without_a_trace():
    """The compiler lets a pad at its body's origin follow the body; shifts need its own position to be read."""
    gripper = load_gripper(str(SECOND))
    model = gripper.compile()
    assert model.geom("west").sameframe[0] == mujoco.mjtSameFrame.mjSAMEFRAME_BODY
    data = mujoco.MjData(model)
    data.ctrl[:] = gripper.motors[0].closed
    mujoco.mj_step(model, data, 1000)
    plant = _plant(gripper, 1)
    plant.advance(np.zeros((1, 2)), 1000)
    assert plant.batch.get_model(0).geom("west").sameframe[0] == mujoco.mjtSameFrame.mjSAMEFRAME_BODYROT
    np.testing.assert_array_equal(plant.batch.bind("qpos")[0], data.qpos)


def test_a_compiled_scene_may_be_changed_and_no_other_is():
    gripper = load_gripper("tiago")
    changed = gripper.compile()
    changed.dof_damping[:] = 7
    assert not (gripper.compile().dof_damping == 7).any()
    assert gripper.compile("fast").opt.timestep > gripper.compile().opt.timestep


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("range", "range", [0.0, 0.05]),
        ('range="0 0.05" armature', 'range="-0.001 0.07" armature', [-0.02, 0.051]),
        ('range="0 0.05" armature', "armature", [-np.inf, np.inf]),
    ],
)
def test_range_of_motors_is_that_of_their_joints(tmp_path, old, new, expected):
    """Joints of the second gripper grow from 0, open, to 0.05 m, closed."""
    gripper = load_gripper(str(_copy(tmp_path, swap={old: new})))
    np.testing.assert_allclose(gripper.motor_range, np.repeat(np.array(expected)[:, None], 2, axis=1), atol=1e-12)
