"""Imports point down, and the physics knows no torch."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
from pathlib import Path


def test_contracts_of_import_linter(root, tmp_path):
    program = Path(sysconfig.get_path("scripts")) / "lint-imports"
    command = [program, "--config", root / "pyproject.toml", "--cache-dir", tmp_path, "--no-logo"]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 broken" in done.stdout


def test_physics_works_without_torch():
    program = """
import sys
for name in ("torch", "torchrl", "tensordict"):
    sys.modules[name] = None  # importing it raises
from forcegrasp.physics import GraspParameters, GraspSimulator
GraspSimulator(2, "fast", threads=1).step([[0.0, 0.0]] * 2)
"""
    subprocess.run([sys.executable, "-c", program], check=True)
