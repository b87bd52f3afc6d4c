"""Effects by name: ours, and those of other packages, by way of entry points."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from forcegrasp.effects import STAGES, catalogue, get_effect
from forcegrasp.effects.registry import ENTRY_POINTS
from forcegrasp.errors import ConfigError

MODULE = """
from forcegrasp.effects import Effect, Parameter

class Doubled(Effect):
    \"\"\"Reads forces many times too high.\"\"\"

    name = "force_doubled"
    stage = "sensor"
    symptom = "forces are too high"
    formula = "f' = (1 + g) f"
    source = "a test"
    look_alikes = ("force_bias",)
    separates = "nothing"
    parameters = (Parameter("gain", "excess g", "1", 0.0, 9.0, 1.0, trials=(0.5,)),)

    def read_force(self, force):
        return force * (1 + self["gain"])

class Nowhere(Doubled):
    name = "nowhere"
    stage = "cloud"

class Ours(Doubled):
    name = "force_bias"

number = 3
"""
SHOW = """
from forcegrasp.effects import catalogue
from forcegrasp.errors import ConfigError
try:
    print(*catalogue())
except ConfigError as error:
    print("ConfigError:", error)
"""


def run(folder: Path, program: str, **points: str) -> str:
    """What a program prints where another package registers these entry points."""
    info = folder / "grippy-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: grippy\nVersion: 1.0\n")
    lines = "\n".join(f"{name} = {value}" for name, value in points.items())
    (info / "entry_points.txt").write_text(f"[{ENTRY_POINTS}]\n{lines}\n")
    (folder / "grippy.py").write_text(MODULE)
    program = f"import sys; sys.path.insert(0, {str(folder)!r})\n{program}"
    done = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_catalogue_is_in_the_order_of_stages():
    effects = list(catalogue().values())
    assert [e.name for e in effects] == list(catalogue())
    assert "none" not in catalogue()
    ranks = [(STAGES.index(e.stage), e.order) for e in effects]
    assert ranks == sorted(ranks)
    assert {e.stage for e in effects} == set(STAGES)


def test_no_two_effects_share_a_place():
    """Effects of one stage that do the same kind of thing have a fixed order among them."""
    places = [(e.stage, e.order, hook) for e in catalogue().values() for hook in e.hooks() - {"act", "change_model"}]
    assert len(places) == len(set(places))


def test_every_effect_can_be_had_by_name():
    assert all(get_effect(name) is effect for name, effect in catalogue().items())
    assert get_effect("none").parameters == ()


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("backlsh", "backlash"),
        ("coulomb", "coulomb_friction"),
        ("force_offset", "force_"),
        ("", "forcegrasp effects lists them"),
    ],
)
def test_unknown_names_tell_the_closest(name, near):
    with pytest.raises(ConfigError, match="no such effect") as caught:
        get_effect(name)
    assert near in str(caught.value)
    assert "\n" not in str(caught.value)


def test_effect_of_another_package_is_found_listed_and_used(tmp_path):
    program = """
import numpy as np
from forcegrasp.cli.main import main
from forcegrasp.effects import catalogue, get_effect
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant
names = list(catalogue())
assert len(names) > 20 and "force_doubled" in names, names
assert main(["effects"]) == 0 and main(["effects", "force_doubled"]) == 0
plant = Plant(load_gripper("tiago"), 2, "fast", threads=1)
plant.attach([(get_effect("force_doubled")(np.array([[2.0]]), plant.dt), np.array([1]))])
plant.reset(np.arange(2), np.zeros(2))
plant.advance(np.full((2, 2), 0.022), 400)
assert plant.force.min() > 0.01
assert np.array_equal(plant.measured_force, plant.force * [[1], [3]])
"""
    printed = run(tmp_path, program, force_doubled="grippy:Doubled")
    assert printed.count("force_doubled") == 2
    assert "f' = (1 + g) f" in printed


@pytest.mark.parametrize(
    ("point", "value", "told"),
    [
        ("force_doubled", "grippy_gone:Doubled", "No module named 'grippy_gone'"),
        ("force_doubled", "grippy:Gone", "could not be loaded"),
        ("number", "grippy:number", "must be a subclass of forcegrasp.effects.Effect"),
        ("twice", "grippy:Doubled", "must have that very name"),
        ("nowhere", "grippy:Nowhere", "a stage out of command, actuator"),
        ("force_bias", "grippy:Ours", "free in the catalogue"),
    ],
)
def test_broken_effect_of_another_package_is_one_clear_error(point, value, told, tmp_path):
    printed = run(tmp_path, SHOW, **{point: value})
    assert printed.startswith(f"ConfigError: effect {point} ({value}): ")
    assert told in printed
    assert printed.count("\n") == 1
