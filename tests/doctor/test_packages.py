"""Wrong versions, wrong pairs, MuJoCo upgraded in place, modules that can't be imported."""

from __future__ import annotations

import ast
import platform
import sys
from importlib.metadata import PackagePath
from types import SimpleNamespace

import pytest

from forcegrasp.doctor import child, packages
from forcegrasp.doctor.packages import (
    check_extras,
    check_imports,
    check_mujoco,
    check_python,
    check_requirements,
    check_torch_family,
)


@pytest.mark.parametrize("check", [check_python, check_requirements, check_torch_family, check_mujoco])
def test_sound(check, environment, told):
    told(check, "fine")


def test_python_too_old(environment, told, monkeypatch):
    monkeypatch.setattr(platform, "python_version", lambda: "3.10.4")
    line = told(check_python, "mend")
    assert "3.10.4" in line
    assert ">=3.11 is needed; make a new environment" in line


def test_another_system(environment, told, monkeypatch):
    monkeypatch.setattr(sys, "platform", "win32")
    assert "Linux and macOS" in told(check_python, "warning")


@pytest.mark.parametrize(
    ("package", "version", "text"),
    [
        ("numpy", "1.26.4", "numpy 1.26.4 is installed, >=2.0 is needed; pip install 'numpy>=2.0'"),
        ("numpy", None, "numpy is not installed; pip install 'numpy>=2.0'"),
        ("tensorboard", "2.20.0", "tensorboard 2.20.0 is installed, ==2.21.0 is needed"),
        ("sympy", "1.12", "sympy 1.12 is installed, >=1.13 is needed (for torch); pip install 'sympy>=1.13'"),
        ("sympy", None, "sympy is not installed (for torch); pip"),
    ],
)
def test_wrong_requirement(package, version, text, environment, told):
    if version is None:
        del environment[package]
    else:
        environment[package].version = version
    assert text in told(check_requirements, "mend")


def test_requirements_are_left_to_another_check_without_metadata(environment):
    del environment["forcegrasp"]
    assert not list(check_requirements())


@pytest.mark.parametrize(
    ("versions", "text"),
    [
        (
            {"tensordict": "0.15.0"},
            "tensordict 0.15.0 is installed, ==0.14.3 is needed, torchrl wants tensordict<0.15.0",
        ),
        ({"torchrl": "0.13.2"}, "torchrl 0.13.2 is installed, ==0.14.1 is needed"),
        ({"torch": "2.12.1"}, "torch 2.12.1 is installed, ~=2.13.0 is needed"),
        ({"torch": "2.14.0+cu130", "torchrl": "0.15.0", "tensordict": "0.15.0"}, "do not work together"),
        ({"torchrl": None}, "torchrl is not installed"),
    ],
)
def test_torch_family_of_different_houses(versions, text, environment, told):
    for name, version in versions.items():
        if version is None:
            del environment[name]
        else:
            environment[name].version = version
    line = told(check_torch_family, "mend")
    assert text in line
    assert line.endswith("pip install 'torch~=2.13.0' 'torchrl==0.14.1' 'tensordict==0.14.3'")


def test_mujoco_not_installed(environment, told):
    del environment["mujoco"]
    assert told(check_mujoco, "mend").endswith("pip install 'mujoco~=4.0.0'")


def test_mujoco_3(environment, told):
    environment["mujoco"].version = "3.4.0"
    assert "fresh environment" in told(check_mujoco, "mend")


def test_mujoco_5(environment, told):
    environment["mujoco"].version = "5.0.0"
    assert told(check_mujoco, "mend").endswith("pip install 'mujoco~=4.0.0'")


def test_mujoco_in_unlike_parts(environment, told):
    environment["mujoco-core"].version = "4.0.1"
    line = told(check_mujoco, "mend")
    assert "mujoco is 4.0.0, but mujoco-core 4.0.1" in line
    assert line.endswith("pip install 'mujoco==4.0.0' 'mujoco-core==4.0.0' 'mujoco-studio==4.0.0'")


def test_mujoco_without_its_core(environment, told):
    del environment["mujoco-core"]
    line = told(check_mujoco, "mend")
    assert "mujoco-core is not installed" in line
    assert "fresh environment" in line


def test_mujoco_upgraded_in_place(environment, told, tmp_path):
    """pip removes the old package's files after it has written those of the new parts, which have the same names."""
    files = [PackagePath(name) for name in ("mujoco/_specs.so", "mujoco/_structs.so", "mujoco/gone.pyc")]
    for file in files:
        file.dist = SimpleNamespace(locate_file=lambda path: tmp_path / path)
    (tmp_path / "mujoco").mkdir()
    (tmp_path / "mujoco" / "_structs.so").touch()
    environment["mujoco-core"].files = files
    line = told(check_mujoco, "mend")
    assert "1 files of mujoco-core are missing (_specs.so" in line
    assert "fresh environment" in line


def test_extras_are_notes(environment):
    del environment["rosbags"]
    environment["onnx"].version = "1.0"
    lines = [finding.line() for finding in check_extras()]
    assert [finding.level for finding in check_extras()] == ["note", "note", "fine", "fine", "fine", "fine"]
    assert "onnx 1.0 is installed, >=1.19 is needed; if you want it: pip install 'forcegrasp[onnx]'" in lines[0]
    assert "rosbags is not installed; if you want it: pip install 'forcegrasp[rosbag]'" in lines[1]
    environment["forcegrasp"].requires = []
    assert all("does not know it" in finding.text for finding in check_extras())


def test_imports(told, monkeypatch, tmp_path):
    monkeypatch.setattr(packages, "MODULES", ("json", "csv"))
    assert "all 2 modules" in told(check_imports, "fine")


@pytest.mark.parametrize(
    ("program", "text"),
    [
        (
            "import sys; sys.modules['numpy'] = None; import numpy.linalg",
            "broken can't be imported (ModuleNotFoundError",
        ),
        ("raise RuntimeError('two\\n  lines')", "broken can't be imported (RuntimeError: two lines)"),
        ("import os; os.abort()", "broken can't be imported (the process died of SIGABRT)"),
        ("raise SystemExit(3)", "broken can't be imported (exit status 3)"),
    ],
)
def test_broken_module(program, text, told, monkeypatch, tmp_path):
    (tmp_path / "broken.py").write_text(program)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(packages, "MODULES", ("json", "broken"))
    assert text in told(check_imports, "mend")


def test_modules_that_break_alike_are_one_line(told, monkeypatch, tmp_path):
    (tmp_path / "one.py").write_text("raise OSError('no library')")
    (tmp_path / "two.py").write_text("import one")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(packages, "MODULES", ("one", "two"))
    assert "one, two can't be imported (OSError: no library)" in told(check_imports, "mend")


def test_missing_modules(told, monkeypatch):
    monkeypatch.setattr(packages, "MODULES", ("not_there", "json", "not_here.either"))
    assert "not there: not_there, not_here.either; install" in told(check_imports, "mend")


def test_a_process_loads_no_opengl_unless_it_is_asked_to(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "egl")
    program = "import os; print(os.environ['MUJOCO_GL'])"
    assert child.run_python("-c", program).output == "disable\n"
    assert child.run_python("-c", program, MUJOCO_GL="osmesa").output == "osmesa\n"


def test_a_process_that_does_not_answer(monkeypatch):
    monkeypatch.setattr(child, "LIMIT_S", 0.1)
    assert child.run_python("-c", "import time; time.sleep(9)").failure == "no answer within 0.1 s"


def test_every_package_that_is_imported_is_tried(root):
    imported = set()
    for path in (root / "forcegrasp").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                imported |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                imported.add((node.module or "").partition(".")[0])
    of_extras = {"rosbags", "onnx", "onnxruntime", "onnxscript", "mujoco_warp", "warp"}
    for_types_only = {"typing_extensions"}
    with_others = {"markupsafe"}  # of jinja2
    others = imported - set(sys.stdlib_module_names) - {"forcegrasp"} - of_extras - for_types_only - with_others
    assert others == {module.partition(".")[0] for module in packages.MODULES}
