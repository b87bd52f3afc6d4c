"""Installations that are not there."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import PackagePath
from pathlib import Path

import pytest

from forcegrasp.doctor import installation, packages
from forcegrasp.doctor.finding import Finding

#: Package → version, and what it needs, as far as the doctor asks.
SOUND = {
    "forcegrasp": (
        "0.1.0",
        "torch~=2.13.0",
        "torchrl==0.14.1",
        "tensordict==0.14.3",
        "mujoco~=4.0.0",
        "numpy>=2.0",
        "tensorboard==2.21.0",
        'rosbags>=0.10; extra == "rosbag"',
        'onnx>=1.19; extra == "onnx"',
        'ray==2.60.0; extra == "ray"',
        'hydra-submitit-launcher==1.2.0; extra == "cluster"',
        'imageio-ffmpeg>=0.6; extra == "video"',
        'mujoco-warp==4.0.0; extra == "warp"',
        'pytest; extra == "dev"',
    ),
    "torch": ("2.13.0+cpu", "sympy>=1.13"),
    "sympy": ("1.14.0",),
    "torchrl": ("0.14.1", "torch>=2.1.0", "tensordict<0.15.0,>=0.14.3"),
    "tensordict": ("0.14.3", "torch", 'orjson; python_version < "3"'),
    "mujoco": ("4.0.0", "mujoco-core==4.0.0"),
    "mujoco-core": ("4.0.0",),
    "numpy": ("2.4.6",),
    "tensorboard": ("2.21.0", "numpy>=1.12"),
    "rosbags": ("0.11.9",),
    "onnx": ("1.23.2",),
    "ray": ("2.60.0",),
    "hydra-submitit-launcher": ("1.2.0",),
    "imageio-ffmpeg": ("0.8.1",),
    "mujoco-warp": ("4.0.0",),
}


class FakeDistribution:
    """As much of a package's metadata as the doctor reads."""

    def __init__(self, version: str, *requires: str) -> None:
        self.version, self.requires = version, list(requires)
        self.metadata = {"Requires-Python": ">=3.11"}
        self.files: list[PackagePath] = []
        self.origin: str | None = None
        self.home = Path(packages.__file__).parents[2]

    def read_text(self, name: str) -> str | None:
        return self.origin if name == "direct_url.json" else None

    def locate_file(self, path: str) -> Path:
        return self.home / path


@pytest.fixture
def environment(monkeypatch) -> dict[str, FakeDistribution]:
    """A sound environment by package; change it and see what the doctor says."""
    there = {name: FakeDistribution(*facts) for name, facts in SOUND.items()}
    monkeypatch.setattr(packages, "installed", there.get)
    monkeypatch.setattr(installation, "installed", there.get)
    return there


@pytest.fixture
def told() -> Callable[..., str]:
    """``told(check, level)``: what a check says, which must be one line of that level."""

    def one_line(check, level: str) -> str:
        (finding,) = found = list(check())
        assert isinstance(finding, Finding)
        assert finding.level == level, found
        assert level == "fine" or finding.remedy or level == "note"
        assert "\n" not in finding.line()
        return finding.line()

    return one_line
