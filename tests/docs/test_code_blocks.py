"""The code in the documentation runs as it stands."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
import torch
import yaml
from doc_pages import PAGES, blocks, program, unpack

from forcegrasp.cli.main import main
from forcegrasp.cli.options import SCHEMAS
from forcegrasp.cli.verbs import VERBS
from forcegrasp.config import ObservationConfig, PhysicsConfig
from forcegrasp.deploy import Contract, controller
from forcegrasp.doctor.gripper import check_gripper
from forcegrasp.env import build_env
from forcegrasp.errors import ConfigError
from forcegrasp.observation import PARTS, Part
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant

#: Pages whose Python runs here as it stands; the others have tests of their own.
RUN = [
    "docs/calibration.md",
    "docs/quickstart.md",
    "docs/write-a-transform.md",
    "docs/write-an-effect.md",
    "docs/your-gripper.md",
]
ELSEWHERE = {
    "README.md",
    "docs/compare-your-data.md",
    "docs/deploy.md",
    "docs/gpu.md",
    "docs/python.md",
    "docs/tutorial.md",
}


@pytest.fixture
def page(tmp_path, monkeypatch):
    """``page(name)``: goes to a folder that holds a page's files; returns its Python blocks, as one program."""

    def read(name: str) -> str:
        unpack(name, tmp_path)
        return program(name)

    before = set(sys.modules)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    yield read
    for name in set(sys.modules) - before:  # what the page's files defined
        if (tmp_path / f"{name}.py").is_file():
            del sys.modules[name]


def run(name: str, code: str) -> None:
    """Executes a page's program."""
    exec(compile(code, name, "exec"), {"__name__": "__main__"})


@pytest.mark.parametrize("name", RUN)
def test_python_blocks_run(page, name):
    mpl.use("Agg")
    code = page(name)
    assert code.strip()
    run(name, code)


def test_python_of_the_gpu_page_runs_on_a_cpu(warp, page):
    """A few grasps and steps of it."""
    code = page("docs/gpu.md")
    for shown, small in (('"cuda"', '"cpu"'), ("4096", "2"), ("150", "3")):
        assert shown in code
        code = code.replace(shown, small)
    run("docs/gpu.md", code)


def test_no_python_is_left_out():
    assert {name for name in PAGES if program(name).strip()} == {*RUN, *ELSEWHERE}


@pytest.mark.parametrize("name", PAGES)
def test_other_blocks_can_be_read(name):
    readers = {"yaml": yaml.safe_load, "toml": tomllib.loads, "xml": ElementTree.fromstring, "text": str, "sh": str}
    for block in blocks(name):
        if block.language != "python":
            assert readers[block.language](block.code), block


def test_tests_of_the_transform_page_pass(page):
    page("docs/write-a-transform.md")
    module = importlib.import_module("test_filtered_force")
    tests = [value for key, value in vars(module).items() if key.startswith("test_")]
    assert len(tests) == 5
    for test in tests:
        test()


def test_transform_of_the_page_becomes_a_part_by_the_line_that_it_gives(page, monkeypatch):
    page("docs/write-a-transform.md")
    (line,) = [block.code for block in blocks("docs/write-a-transform.md") if block.code.startswith("Part(")]
    (part,) = eval(f"({line})", {"Part": Part})
    monkeypatch.setitem(sys.modules, f"forcegrasp.transforms.{part.transform}", importlib.import_module(part.transform))
    monkeypatch.setitem(PARTS, part.name, part)
    env = build_env(2, physics=PhysicsConfig("fast", 1), observation=ObservationConfig(["force", part.name], 1))
    seen = env.rollout(2)
    torch.testing.assert_close(seen["next", "observation"][..., 2:], seen["next", "filtered_force"])


def test_effect_of_the_page_is_found_once_it_is_installed(page, tmp_path):
    page("docs/write-an-effect.md")
    project = tomllib.loads(Path("pyproject.toml").read_text())
    (name, value), *none = project["project"]["entry-points"]["forcegrasp.effects"].items()
    assert not none
    info = tmp_path / "my_effects-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: my-effects\nVersion: 1\n")
    (info / "entry_points.txt").write_text(f"[forcegrasp.effects]\n{name} = {value}\n")
    command = [sys.executable, "-m", "forcegrasp.cli.main", "effects", name]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert f"{name}: A force sensor whose sensitivity changes" in done.stdout


def test_verb_of_the_page_is_a_verb_once_it_is_registered(page, monkeypatch, capsys):
    page("docs/write-a-verb.md")
    config = importlib.import_module("openings_config").OpeningsConfig
    monkeypatch.setattr("forcegrasp.config.verbs.OpeningsConfig", config, raising=False)
    verb = importlib.import_module("openings").VERB
    monkeypatch.setitem(VERBS, verb.name, verb)
    monkeypatch.setitem(SCHEMAS, verb.name, config)
    assert main(["openings", "franka_hand", "points=3"]) == 0
    assert capsys.readouterr().out.splitlines()[1].split() == ["0.0200", "m", "40.0", "mm"]
    assert main(["openings", "--help"]) == 0
    assert "usage: forcegrasp openings [GRIPPER] [key=value ...]" in capsys.readouterr().out
    for wrong, told in (("pionts=3", "did you mean points?"), ("points=1", "must lie in [2, 1000]")):
        assert main(["openings", wrong]) == 2
        assert told in capsys.readouterr().err


def test_gripper_of_the_page_does_what_the_page_says(page):
    page("docs/your-gripper.md")
    gripper = load_gripper("my_gripper.yaml", Path())
    assert gripper.stroke == 0.04


def complete(name: str) -> None:
    """Sections of an example take the place of those of the whole scene and description."""
    scene = ElementTree.parse("my_gripper.xml").getroot()
    for section in ElementTree.parse(f"{name}.xml").getroot():
        for other in scene.findall(section.tag):
            scene.remove(other)
        scene.append(section)
    Path(f"{name}.xml").write_bytes(ElementTree.tostring(scene))
    description = yaml.safe_load(Path("my_gripper.yaml").read_text()) | yaml.safe_load(Path(f"{name}.yaml").read_text())
    Path(f"{name}.yaml").write_text(yaml.safe_dump(description))


@pytest.mark.parametrize(
    ("name", "columns"),
    [
        ("coupled_slides", "q_m qdes_m f_l_n f_r_n"),
        ("tendon", "q_m qdes_m f_l_n f_r_n"),
        ("coupled_hinges", "q_rad qdes_rad f_l_n f_r_n"),
        ("fixed_jaw", "q_m qdes_m f_l_n f_r_n"),
        ("motor_effort", "q_m qdes_m f_n"),
    ],
)
def test_other_mechanisms_of_the_page_grasp(page, name, columns):
    code = page("docs/your-gripper.md")
    complete(name)
    gripper = load_gripper(f"./{name}.yaml")
    assert " ".join(c.column for c in (*gripper.positions, *gripper.commands, *gripper.forces)) == columns
    plant = Plant(gripper, n=1)
    plant.reset(np.zeros(1, int), np.zeros(1), np.full((1, len(gripper.motors)), gripper.stroke))
    plant.advance(np.zeros((1, len(gripper.motors))), round(2 / plant.dt))
    assert (plant.pad_force > 0.3).all()
    assert not plant.warnings().any()
    if name == "coupled_slides":  # the page's own check is for one motor, too
        mpl.use("Agg")
        run("docs/your-gripper.md", code.replace("my_gripper.yaml", f"{name}.yaml"))


HARD = ' solref="0.004 1" solimp="0.99 0.999 0.0001"'


@pytest.mark.parametrize("name", ["coupled_slides", "coupled_hinges", "motor_effort"])
def test_doctor_warns_of_couplings_without_the_lines_that_make_them_hard(page, name):
    page("docs/your-gripper.md")
    for line in (HARD, ""):
        scene = Path(f"{name}.xml")
        scene.write_text(scene.read_text().replace(HARD, line))
        complete(name)
        told = [finding for finding in check_gripper(f"./{name}.yaml") if finding.about == "coupling"]
        assert [finding.level for finding in told] == ([] if line else ["warning"])


SIDES = "left: {joint: left, force_sensor: left}\n  right: {joint: right, force_sensor: right}"
SWAPPED = "left: {joint: right, force_sensor: left}\n  right: {joint: left, force_sensor: right}"


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("yaml", "joint: left,", "joint: lefft,"),
        ("yaml", "closed: 0.0, open: 0.04", "closed: 0.04, open: 0.0"),
        ("yaml", SIDES, SWAPPED),
        ("yaml", "open: 0.04", "open: 40"),
        ("yaml", "open: 0.04}\n\n", "open: 0.05}\n\n"),
        ("xml", '<position name="left"', '<motor name="left"'),
        ("yaml", "actuator: left", "actuator: right"),
        ("xml", '<joint name="left"', '<joint type="hinge" name="left"'),
        ("yaml", "{joint: left, force_sensor: left}", "{force_sensor: left}"),
        ("yaml", "axis: x\n", "axis: x\nforce: motor\n"),
        ("xml", '"object" type="box"', '"object" type="ellipsoid"'),
        ("yaml", "[dof_damping]", "[dof_dampin]"),
        ("yaml", "[geom_solimp 2]", "[geom_solimp]"),
        ("yaml", "low: 5, high: 100", "low: 30, high: 100"),
        ("xml", "</mujoco>", ""),
        ("yaml", "model: my", "modle: my"),
        ("yaml", "closed: 0.0, open: 0.04", "closed: 0.0, open: 4e-2"),
    ],
)
def test_messages_are_as_quoted(page, file, old, new):
    page("docs/your-gripper.md")
    path = Path(f"my_gripper.{file}")
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(ConfigError) as caught:
        load_gripper("./my_gripper.yaml")
    quoted = re.findall(r"^\| [^|]* \| `([^`]+)`", PAGES["docs/your-gripper.md"], re.MULTILINE)
    assert any(message in str(caught.value) for message in quoted), str(caught.value)


def test_actuators_whose_effort_is_read_may_be_called_left_and_right(page):
    page("docs/your-gripper.md")
    path = Path("my_gripper.yaml")
    sides = "left: {joint: left}\n  right: {joint: right}\nforce: motor"
    path.write_text(path.read_text().replace(SIDES, sides))
    assert [c.column for c in load_gripper("./my_gripper.yaml").forces] == ["f_l_n", "f_r_n"]


def test_loop_of_the_deploy_page_reaches_its_goal(page, capsys):
    run("docs/deploy.md", page("docs/deploy.md"))
    printed = capsys.readouterr().out
    assert [float(number) for number in re.findall(r"\d\.\d+", printed)] == pytest.approx([0.5, 0.5], abs=0.05)


def test_faults_and_entries_of_the_deploy_page_are_those_of_the_controller():
    text = PAGES["docs/deploy.md"]
    table_rows = [re.split(r"(?<!\\)\|", line)[1:-1] for line in text.splitlines() if line.startswith("| ")]
    rows = [row for row in table_rows if len(row) == 3]
    entries = {name for row in rows for name in re.findall(r"`(\w+)`", row[2])}
    assert {"max_delta_m", "ceiling_n", "gap_s"} <= entries <= {field.name for field in dataclasses.fields(Contract)}
    source = inspect.getsource(controller).replace("{name}", "position")
    quoted = [kind for row in rows for kind in re.findall(r"`(\w+ [\w' ]+)`", row[1])]
    assert len(quoted) >= 9
    assert all(kind.replace("force reading", "position reading") in source for kind in quoted)
