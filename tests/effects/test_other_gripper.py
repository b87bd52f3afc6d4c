"""Effects on a gripper that is not TIAGo's: rubbing joints, motors without a limit, joints that grow while closing."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest

from forcegrasp.effects import Effect, catalogue, get_effect
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant, write_base

from .rollouts import read

SECOND = Path(__file__).parents[1] / "grippers" / "second.yaml"
TOUCH_M, GAIN, FRICTION_N = 0.02, 250.0, 0.02
#: Free reversal, a small step, light touch, fast squeeze, partial and full release; an object off the centre.
MOVES = np.array([0.0225, 0.0215, 0.0222, 0.0224, 0.0206, 0.0204, 0.0202, 0.0160, 0.0190, 0.0170, 0.0226])
CASES = [pytest.param(e, v, id=f"{e.name}-{v}".rstrip("-")) for e in catalogue().values() for v in e.variants]


def rollout(*uses: tuple[type[Effect], np.ndarray, str], moves: np.ndarray = MOVES) -> list[bytes]:
    """Every bit of a grasp with base parameters of its own."""
    return [values.tobytes() for values in simulate(*uses, moves=moves)]


def simulate(*uses: tuple[type[Effect], np.ndarray, str], moves: np.ndarray) -> np.ndarray:
    plant, row = Plant(load_gripper(str(SECOND)), 1, threads=1), np.array([0])
    plant.attach([(kind(np.array([values]), plant.dt, variant), row) for kind, values, variant in uses])
    write_base(plant, row, {"joint_friction": np.array([FRICTION_N]), "contact_stiffness": np.array([1500.0])})
    plant.reset(row, np.array([0.0008]), np.full((1, 2), moves[0]))
    seen = []
    for command in moves:
        for _ in range(3):
            plant.advance(np.full((1, 2), command), 40)
            position, force = read(plant)
            seen.append([position[0], force[0], [plant.object_position[0], 0]])
    assert not plant.warnings().any()
    return np.array(seen)


@functools.cache
def bare() -> list[bytes]:
    return rollout()


@pytest.mark.parametrize(("effect", "variant"), CASES)
def test_null_values_change_no_bit(effect, variant):
    assert rollout((effect, effect.null_values(), variant)) == bare()


def test_all_null_values_at_once_change_no_bit():
    assert rollout(*((e, e.null_values(), "") for e in catalogue().values())) == bare()


def test_coulomb_friction_adds_to_the_joints_own():
    """The servo's spring holds what both together may: the base parameter is not overwritten."""
    added = 0.04
    last = simulate((get_effect("coulomb_friction"), np.array([added]), ""), moves=np.array([0.03] + [0.026] * 12))[-1]
    assert last[0] == pytest.approx([0.026 + (added + FRICTION_N) / GAIN] * 2, abs=3e-5)


def test_force_limit_limits_a_motor_that_had_no_limit():
    limit = 0.4
    last = simulate((get_effect("force_limit"), np.array([limit]), ""), moves=np.array([0.022] + [0.01] * 12))[-1]
    base = simulate(moves=np.array([0.022] + [0.01] * 12))[-1]
    assert base[1].min() > 2 * limit
    assert last[1] == pytest.approx([limit] * 2, abs=1.5 * FRICTION_N)
