"""What all tests share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from forcegrasp.config import GraspConfig
from forcegrasp.physics import GraspParameters, GraspSampler

torch.set_num_threads(1)


@pytest.fixture(scope="session")
def root() -> Path:
    """The checkout."""
    return Path(__file__).parents[1]


@pytest.fixture(scope="session")
def draw() -> Callable[..., GraspParameters]:
    """``draw(n, seed=0, **ranges)``: random grasps from the default ranges, or from those given."""

    def grasps(n: int, seed: int = 0, **ranges) -> GraspParameters:
        return GraspSampler(GraspConfig(**ranges))(np.random.default_rng(seed), np.arange(n))

    return grasps
