"""Shapes in annotations hold: tests call simulator, environment and transforms with each shape checked."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from jaxtyping import TypeCheckError

from forcegrasp.env import GraspEnv
from forcegrasp.env.reward import force_reward, normalised_force_reward, object_penalty
from forcegrasp.physics import GraspSimulator
from forcegrasp.transforms import ActionScale, contact_bias

PAIR, ONE = torch.ones(4, 2), torch.ones(4, 1)


@pytest.fixture(scope="module")
def simulator() -> GraspSimulator:
    return GraspSimulator(3, "fast", threads=1)


WRONG = {
    "a force that is a number": lambda simulator: force_reward(torch.tensor(1.0)),
    "a goal per finger": lambda simulator: normalised_force_reward(PAIR, PAIR),
    "a goal for fewer grasps": lambda simulator: normalised_force_reward(PAIR, ONE[:3]),
    "a speed per finger": lambda simulator: object_penalty(PAIR, 0.1),
    "fewer errors than contacts": lambda simulator: contact_bias(PAIR, ONE, ONE, 0.1, 0.9, 2),
    "a goal without its axis": lambda simulator: contact_bias(PAIR, PAIR, PAIR[:, 0], 0.1, 0.9, 2),
    "an action that is a number": lambda simulator: ActionScale(0.1)._inv_apply_transform(torch.tensor(1.0)),
    "a command for one motor": lambda simulator: simulator.step(np.zeros((3, 1))),
    "a command for fewer grasps": lambda simulator: simulator.command(np.zeros((2, 2))),
    "slots as a table": lambda simulator: simulator.reset(simulator.parameters, np.arange(3)[:, None]),
    "slots as numbers with a point": lambda simulator: simulator.reset(simulator.parameters, np.arange(3.0)),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_shape_is_caught(wrong, simulator):
    with pytest.raises(TypeCheckError):
        WRONG[wrong](simulator)


def test_every_file_with_shapes_is_checked(root, pytestconfig):
    """pyproject.toml names them one by one; one that was forgotten would be passed over in silence."""
    files = [path for path in (root / "forcegrasp").rglob("*.py") if "from jaxtyping import" in path.read_text("utf-8")]
    *checked, _ = pytestconfig.getoption("--jaxtyping-packages").split(",")
    assert sorted(checked) == sorted(".".join(path.relative_to(root).with_suffix("").parts) for path in files)


def test_what_a_simulator_returns_is_checked(monkeypatch, simulator):
    monkeypatch.setattr(simulator.plant, "measured_force", np.zeros((3, 3)))
    with pytest.raises(TypeCheckError, match="measured_force"):
        _ = simulator.measured_force


def test_what_the_environment_makes_of_it_is_checked():
    with pytest.raises(TypeCheckError):
        GraspEnv(2)._column(np.zeros(3))
