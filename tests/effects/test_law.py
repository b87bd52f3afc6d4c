"""Effects from files: a closed grammar, and formulas that do in a plant what they say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from forcegrasp.effects.expression import Expression
from forcegrasp.effects.law import read_law, write_law
from forcegrasp.errors import ConfigError, PhysicsError
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant
from forcegrasp.physics.sensors import ReadingEffects

SIGNALS = ("position", "velocity", "force")


def written(folder: Path, place: str, expression: str, name: str = "my_law", **sizes: float) -> Path:
    parameters = {n: {"value": v, "low": min(0.0, 3 * v), "high": max(0.0, 3 * v)} for n, v in sizes.items()}
    parameters |= {n: {**parameters[n], "low": 0.01} for n in parameters if n == "tau"}
    content = {"name": name, "place": place, "expression": expression, "parameters": parameters}
    path = folder / "law.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


@pytest.mark.parametrize(
    "text",
    [
        "c * __import__('os')", "c * open(position)", "c * position.real", "c * position[0]", "c * unknown", "position",
        "c * (lambda: 1)()", "c * position ** velocity", "c * position ** 9", "c * [1]", "c if 1 else 2", "c * 'a'",
        "c * True", "c * 1e400", "c * 2j", "c * None", "c * abs(position, 2)", "c * abs(x=position)", "c * (a := 1)",
        "c * min(*position)", "c * memory(position, 0)", "c * memory(position, -1)", "c * memory(position, velocity)",
        "c * (position < 1)", "c * (position and 1)", "c * ~position", "c * position // 2", "c * position % 2", "(", "",
        "c; c", "c\nimport os", "c * f'{c}'", "c * exp(c)", "exp(c * position)", "c * " + "-" * 500 + "position",
        "c + position", "c * " + "(" * 300 + "position" + ")" * 300, "c @ c",
    ],
)  # fmt: skip
def test_all_else_is_refused_in_one_line(text):
    with pytest.raises(ValueError, match=r"^[^\n]+$"):
        Expression(text, SIGNALS, ("c",))


def test_an_expression_comes_to_what_it_says():
    text = "c * abs(velocity) * velocity - 2 * d * tanh(force / 0.1) + e * max(position, 0)**2 / (1 + exp(-force))"
    parsed = Expression(text, SIGNALS, ("c", "d", "e"))
    rng = np.random.default_rng(0)
    q, v, f = rng.standard_normal((3, 4, 2))
    c, d, e = rng.standard_normal((3, 4, 1))
    got = parsed.value({"position": q, "velocity": v, "force": f}, {"c": c, "d": d, "e": e}, {}, 0.01)
    expected = c * np.abs(v) * v - 2 * d * np.tanh(f / 0.1) + e * np.maximum(q, 0) ** 2 / (1 + np.exp(-f))
    np.testing.assert_allclose(got, expected, rtol=1e-14)
    assert parsed.coefficients == ("c", "d", "e")
    assert parsed.uses == set(SIGNALS)


def test_memory_is_a_lag_that_starts_from_nothing():
    parsed = Expression("c * memory(force, tau)", SIGNALS, ("c", "tau"))
    state, one = parsed.memory(1, 1), np.ones((1, 1))
    got = [parsed.value({"force": 3 * one}, {"c": 2 * one, "tau": 0.4 * one}, state, 0.01) for _ in range(50)]
    assert got[-1] == pytest.approx(2 * 3 * (1 - np.exp(-0.5 / 0.4)))


@pytest.mark.parametrize(
    ("place", "expression", "sizes"),
    [
        ("motor", "c * abs(velocity) * velocity", {"c": -300.0}),
        ("motor", "c * sign(force)", {"c": 0.02}),
        ("command", "c * position", {"c": -0.1}),
        ("force", "c * force * abs(force) + d * acceleration", {"c": 0.5, "d": 0.05}),
        ("position", "c * memory(force, tau)", {"c": 1e-3, "tau": 0.1}),
    ],
)
def test_a_law_acts_and_at_zero_changes_no_bit(tmp_path, place, expression, sizes):
    law = read_law(written(tmp_path, place, expression, **sizes), load_gripper("tiago"))
    plant = Plant(load_gripper("tiago"), 3, "fast", threads=1)
    plant.attach([(law(np.array([law.null_values(), law.typical_values()]), plant.dt), np.array([1, 2]))])
    plant.reset(np.arange(3), np.zeros(3))
    moved = np.empty((400, 3, 2))
    for step in range(400):
        plant.advance(np.full((3, 2), 0.022))
        moved[step] = plant.measured_position + plant.measured_force
    assert np.array_equal(moved[:, 0], moved[:, 1])
    assert np.abs(moved[:, 2] - moved[:, 0]).max() > 1e-4
    if expression.startswith("c * force"):
        assert plant.measured_force[2] == pytest.approx(plant.force[2] * (1 + 0.5 * plant.force[2]), rel=0.01)
    if place == "command":
        assert (plant.position[2] < plant.position[0]).all()
    write_law(law, tmp_path / "again.yaml")
    again = read_law(tmp_path / "again.yaml", load_gripper("tiago"))
    assert (again.name, again.formula, again.parameters) == (law.name, law.formula, law.parameters)


@pytest.mark.parametrize(
    ("place", "expression"),
    [("force", "c * position"), ("force", "c * acceleration"), ("position", "c * force"), ("force", "c * force**2")],
)
def test_a_law_of_readings_sees_position_and_force_of_one_instant(tmp_path, place, expression):
    """A whole grasp was read position after position, and then force after force: each with the last position."""
    law = read_law(written(tmp_path, place, expression, c=0.5), load_gripper("tiago"))
    positions, forces = np.random.default_rng(0).random((2, 1, 6, 2))
    whole, by_instant = (ReadingEffects([law(law.typical_values()[None], 0.002)]) for _ in range(2))
    read = positions.copy(), forces.copy()
    whole.apply_to_all(*read)
    expected = positions.copy(), forces.copy()
    for step in range(6):
        by_instant.apply(expected[0][:, step], expected[1][:, step])
    np.testing.assert_array_equal(read, expected)
    if expression == "c * position":
        np.testing.assert_allclose(read[1], forces + 0.5 * positions)


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"expression": "c * foo"}, "expression: foo: unknown"),
        ({"expression": "c * position + d"}, "expression: d: unknown"),
        ({"expression": "c * command", "place": "force"}, "expression: command: unknown"),
        ({"place": "table"}, "place: must be 'motor'|place: must be motor"),
        ({"name": "backlash"}, "backlash is an effect of the catalogue"),
        ({"name": "my law"}, "name: must be letters"),
        ({"parameters": {"c": {"value": 0, "low": -1, "high": 1}}}, "value must not be 0"),
        ({"parameters": {"c": {"value": 1, "low": 0.5, "high": 2}}}, "0 must lie in"),
        ({"parameters": {"c": {"value": 3, "low": -1, "high": 1}}}, "low ≤ value ≤ high"),
        ({"parameters": {"c": 1, "force": 2}}, "parameters"),
        ({"code": "import os"}, "code: unknown"),
    ],
)
def test_a_file_that_is_wrong_is_refused_in_one_line(tmp_path, changes, problem):
    path = written(tmp_path, "motor", "c * velocity", c=-1.0)
    path.write_text(yaml.safe_dump(yaml.safe_load(path.read_text()) | changes))
    with pytest.raises(ConfigError, match=problem) as refused:
        read_law(path, load_gripper("tiago"))
    assert "law.yaml" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_formula_without_a_value_is_refused_where_it_happens(tmp_path):
    law = read_law(written(tmp_path, "motor", "c / (position - position)", c=1.0), load_gripper("tiago"))
    plant = Plant(load_gripper("tiago"), 1, "fast", threads=1)
    plant.attach([(law(law.typical_values()[None], plant.dt), np.array([0]))])
    plant.reset(np.arange(1), np.zeros(1))
    with pytest.raises(PhysicsError, match="my_law"):
        plant.advance(np.full((1, 2), 0.03))


def test_a_law_tells_left_from_right(tmp_path):
    path = written(tmp_path, "motor", "c * side", c=0.02)
    law = read_law(path, load_gripper("tiago"))
    plant = Plant(load_gripper("tiago"), 1, "fast", threads=1)
    plant.attach([(law(np.array([[0.02]]), plant.dt), np.array([0]))])
    plant.reset(np.arange(1), np.zeros(1))
    plant.advance(np.full((1, 2), 0.03), 1)
    assert plant.motor_push[0].tolist() == [0.02, -0.02]
    with pytest.raises(ConfigError, match=r"side tells left from right, and robotiq_2f85 has not both at motor"):
        read_law(path, load_gripper("robotiq_2f85"))
