"""Every gripper that comes with the package."""

from __future__ import annotations

import pytest

from forcegrasp.physics import Gripper
from forcegrasp.physics.gripper_file import load_gripper, shipped_grippers


@pytest.fixture(scope="session", params=shipped_grippers())
def gripper(request) -> Gripper:
    return load_gripper(request.param)
