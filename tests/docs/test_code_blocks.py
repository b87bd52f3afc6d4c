"""The code in the documentation runs as it stands."""

from __future__ import annotations

import dataclasses
import inspect
import re
from pathlib import Path

import matplotlib as mpl
import pytest

from forcegrasp.deploy import Contract, controller
from forcegrasp.errors import ConfigError
from forcegrasp.physics.gripper import load_gripper

#: Language, the file a block is said to be (the word after the language), its text.
_BLOCK = re.compile(r"^```(\w+)(?: (\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.fixture
def page(root, tmp_path, monkeypatch):
    """``page(name)``: goes to a folder that holds a page's files; returns its Python blocks, as one program."""

    def unpack(name: str) -> str:
        text = (root / "docs" / name).read_text(encoding="utf-8")
        program = ""
        for block in _BLOCK.finditer(text):
            language, file, code = block.groups()
            if file:
                Path(tmp_path, file).write_text(code, encoding="utf-8")
            elif language == "python":
                # the line numbers of a traceback are the page's
                program += "\n" * (text[: block.start(3)].count("\n") - program.count("\n")) + code
        return program

    monkeypatch.chdir(tmp_path)
    return unpack


@pytest.mark.parametrize("name", ["calibration.md", "your-gripper.md"])
def test_python_blocks_run(page, root, name):
    mpl.use("Agg")
    program = page(name)
    assert program.strip()
    exec(compile(program, str(root / "docs" / name), "exec"), {"__name__": "__main__"})


def test_gripper_of_the_page_does_what_the_page_says(page):
    page("your-gripper.md")
    gripper = load_gripper("my_gripper.yaml", Path())
    assert gripper.open_m == 0.04


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("yaml", "joints: [left,", "joints: [lefft,"),
        ("yaml", "joints: [left, right]", "joints: [right, left]"),
        ("yaml", "open: 0.04", "open: 40"),
        ("xml", '<position name="left"', '<motor name="left"'),
        ("yaml", "actuators: [left, right]", "actuators: [right, left]"),
        ("xml", '<joint name="left"', '<joint type="hinge" name="left"'),
        ("xml", '"object" type="box"', '"object" type="ellipsoid"'),
        ("yaml", "[dof_damping]", "[dof_dampin]"),
        ("yaml", "[geom_solimp 2]", "[geom_solimp]"),
        ("yaml", "low: 5, high: 100", "low: 30, high: 100"),
        ("xml", "</mujoco>", ""),
    ],
)
def test_messages_are_as_quoted(page, root, file, old, new):
    page("your-gripper.md")
    path = Path(f"my_gripper.{file}")
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(ConfigError) as caught:
        load_gripper("./my_gripper.yaml")
    quoted = re.findall(r"^\| [^|]* \| `([^`]+)`", (root / "docs/your-gripper.md").read_text(), re.MULTILINE)
    assert any(message in str(caught.value) for message in quoted), str(caught.value)


def test_loop_of_the_deploy_page_reaches_its_goal(page, root, capsys):
    code = compile(page("deploy.md"), str(root / "docs/deploy.md"), "exec")
    exec(code, {"__name__": "__main__"})
    printed = capsys.readouterr().out
    assert [float(number) for number in re.findall(r"\d\.\d+", printed)] == pytest.approx([0.5, 0.5], abs=0.05)


def test_faults_and_entries_of_the_deploy_page_are_those_of_the_controller(root):
    text = (root / "docs/deploy.md").read_text(encoding="utf-8")
    table_rows = [re.split(r"(?<!\\)\|", line)[1:-1] for line in text.splitlines() if line.startswith("| ")]
    rows = [row for row in table_rows if len(row) == 3]
    entries = {name for row in rows for name in re.findall(r"`(\w+)`", row[2])}
    assert {"max_delta_m", "ceiling_n", "gap_s"} <= entries <= {field.name for field in dataclasses.fields(Contract)}
    source = inspect.getsource(controller).replace("{name}", "position")
    quoted = [kind for row in rows for kind in re.findall(r"`(\w+ [\w' ]+)`", row[1])]
    assert len(quoted) >= 9
    assert all(kind.replace("force reading", "position reading") in source for kind in quoted)
