"""The simulator still does what it did when its trajectories were last approved, see ``tools/golden.py``."""

from __future__ import annotations

import runpy

import numpy as np
import pytest

TIERS = pytest.mark.parametrize("tier", ["reference", "fast"])


@pytest.fixture(scope="module")
def tool(root):
    return runpy.run_path(str(root / "tools" / "golden.py"))


@TIERS
def test_simulator_repeats_the_golden_trajectories(tool, tier):
    found = tool["deviations"](tool["simulate"](tier), tool["read"](tier))
    assert not tool["beyond"](tier, found), found


@TIERS
def test_golden_trajectories_tell_something(tool, tier):
    golden = tool["read"](tier).reshape(6, -1, 7)
    assert (golden[:, :, 4:6].max(axis=1) > 0.05).any(axis=1).all()  # every grasp touches
    assert (golden[:, 0, 4:6] == 0).all(axis=1).sum() >= 4  # and most of them fly first
    assert np.ptp(golden[:, :, 6], axis=1).max() > 5e-3  # an object is pushed


@TIERS
@pytest.mark.parametrize(
    ("row", "column", "change"),
    [(0, 2, 1e-8), (9, 0, 1), (9, 1, 1), (-1, 2, 3e-6), (-1, 3, np.nan), (-1, 4, 0.04), (-1, 5, np.nan), (-1, 6, 3e-6)],
)
def test_a_change_would_be_noticed(tool, tier, row, column, change):
    golden = tool["read"](tier)
    changed = golden.copy()
    changed[row, column] += change
    assert not tool["beyond"](tier, tool["deviations"](golden, golden))
    assert tool["beyond"](tier, tool["deviations"](changed, golden))
