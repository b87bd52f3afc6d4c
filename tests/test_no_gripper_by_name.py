"""The package knows grippers by their descriptions alone: no name and no number of the paper's stands in its code."""

from __future__ import annotations

import ast
import io
import tokenize
from pathlib import Path

import pytest

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.physics import default_gripper

PACKAGE = Path(__file__).parents[1] / "forcegrasp"
#: Data, and where presets are.
DATA = {"assets", "policies", "conf"}
#: Numbers of its description that no other quantity of the package happens to have.
GRIPPER = default_gripper()
NUMBERS = {GRIPPER.stroke, GRIPPER.stroke / 2, GRIPPER.max_step, GRIPPER.training.position_std}
NUMBERS |= {GRIPPER.training.force_std_n, GRIPPER.training.assumed_stiffness}
#: Sizes of effects are given for the paper's gripper, and scaled for others.
SIZES = "effects/"
FILES = sorted(path for path in PACKAGE.rglob("*.py") if path.relative_to(PACKAGE).parts[0] not in DATA)


def names_in_code(text: str) -> list[str]:
    """Lines with the gripper's name, but for comments, docstrings and what cites the authors' code as its source."""
    found = []
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if DEFAULT_GRIPPER in token.string.lower():
            prose = token.type == tokenize.COMMENT or token.string.startswith('"""') or "authors' code" in token.string
            found += [] if prose else [token.line.strip()]
    return found


def numbers_in_code(text: str) -> list[float]:
    constants = (node.value for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant))
    return [value for value in constants if isinstance(value, float) and value in NUMBERS]


def test_the_scan_sees_what_it_should():
    assert names_in_code('"""Of TIAGo."""\nx = 1  # as TIAGo has it\n') == []
    assert names_in_code('x = load("Tiago")\n') == ['x = load("Tiago")']
    assert names_in_code("def read_tiago():\n    pass\n") == ["def read_tiago():"]
    assert numbers_in_code("x = 0.045 + 3e-3 + 0.004") == [0.045, 0.003]
    assert len(FILES) > 100


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_no_name_and_no_number_of_one_gripper(path):
    text, name = path.read_text(encoding="utf-8"), path.relative_to(PACKAGE).as_posix()
    assert names_in_code(text) == []
    if not name.startswith(SIZES):
        assert numbers_in_code(text) == []
