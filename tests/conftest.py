"""What all tests share."""

from __future__ import annotations

import gc
import os
import signal
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from not_tested import pytest_terminal_summary  # noqa: F401  (a hook: pytest calls it)

if TYPE_CHECKING:
    from forcegrasp.physics import GraspParameters

# A worker of xdist, and what tests start, has one core: threads that wait for one another would only take it.
os.environ.setdefault("OMP_NUM_THREADS", "1")

#: Folders of the longest files: they come first, lest one worker is still at such a file when the others have ended.
LONGEST = (
    *("diagnosis", "config", "cli", "train", "docs", "reliability", "effects", "importers", "evaluate", "tools"),
    *("identify", "transforms", "env", "reports", "deploy", "replay", "grippers", "physics", "independent"),
)

#: Folders that train and evaluate by the hundred, in environments whose shapes the other folders check: to check them
#: there again would take a third of their time.
WHOLE_RUNS = ("config", "train", "evaluate", "cli", "docs")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Puts the tests in the order in which xdist hands their files to its workers."""
    items.sort(key=lambda item: next((i for i, name in enumerate(LONGEST) if item.path.parent.name == name), 99))


def pytest_collection_finish() -> None:
    """In who runs tests, not in who hands them out, which need not import for that what they test."""
    import torch

    from forcegrasp.replay import replay

    torch.set_num_threads(1)
    replay.THREADS = 1
    gc.freeze()  # what is imported by now stays: to look for garbage in it took a tenth of the tests' time


@pytest.fixture(autouse=True, scope="module")
def shapes_are_checked(request) -> Iterator[None]:
    """Each annotated shape at each call, but in the folders of WHOLE_RUNS."""
    from jaxtyping import config

    config.update("jaxtyping_disable", request.path.parent.name in WHOLE_RUNS)
    yield
    config.update("jaxtyping_disable", False)


@pytest.fixture(scope="session")
def root() -> Path:
    """The checkout."""
    return Path(__file__).parents[1]


@pytest.fixture(scope="session")
def draw() -> Callable[..., GraspParameters]:
    """``draw(n, seed=0, **ranges)``: random grasps from the default ranges, or from those given."""

    import numpy as np

    from forcegrasp.config import GraspConfig
    from forcegrasp.physics import GraspSampler

    def grasps(n: int, seed: int = 0, **ranges) -> GraspParameters:
        return GraspSampler(GraspConfig(**ranges))(np.random.default_rng(seed), np.arange(n))

    return grasps


@pytest.fixture(scope="session")
def warp() -> None:
    """Skips a test unless MuJoCo Warp is installed and has compiled kernels here, or FORCEGRASP_WARP is set.

    To compile them takes a minute or so, once per machine.
    """
    if find_spec("mujoco_warp") is None or find_spec("warp") is None:
        pytest.skip("MuJoCo Warp is not installed: pip install 'forcegrasp[warp]'")
    from forcegrasp.gpu.installation import kernels_are_cached, start_warp

    start_warp()
    if not (kernels_are_cached() or os.environ.get("FORCEGRASP_WARP")):
        pytest.skip("Warp's kernels are not compiled here; set FORCEGRASP_WARP=1 to have it done")


@pytest.fixture
def hang_ups_arrive() -> Iterator[None]:
    """As in a terminal, though the tests may have been started with nohup, which ignores hang-ups."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)
