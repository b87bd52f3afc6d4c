"""The authors' simulator at six instants of each recorded episode: what every clone can hold the physics against.

Tolerances are those of ``test_reference.py``, which has the whole episodes where they are at hand.
"""

from __future__ import annotations

import numpy as np
import pytest
from authors_episodes import EPISODES, INSTANTS, actions, parameters

from forcegrasp.physics import GraspSimulator

STEPS = [24, 49, 74, 99, 124, 149]  #: the end of each second
RECORDED = ("q_l_m", "q_r_m", "f_l_n", "f_r_n", "object_y_m")


def _deviations(tier: str) -> list[np.ndarray]:
    """Magnitude of simulated minus recorded values, each ``(episode, instant, 1 or 2)``, in the order of RECORDED."""
    simulator = GraspSimulator(len(EPISODES), tier)
    simulator.reset(parameters(EPISODES))
    simulated = []
    for step, action in enumerate(np.stack([actions(row["actions"]) for row in EPISODES], 1)):
        simulator.step(0.003 * action)
        if step in STEPS:
            state = simulator.joint_position, simulator.force, simulator.object_position[:, None]
            simulated.append(np.concatenate(state, 1))
    recorded = np.array([[float(row[column]) for column in RECORDED] for row in INSTANTS])
    difference = np.abs(np.stack(simulated, 1) - recorded.reshape(len(EPISODES), len(STEPS), len(RECORDED)))
    return np.split(difference, [2, 4], axis=2)


@pytest.fixture(scope="module")
def deviations() -> dict[str, list[np.ndarray]]:
    """Tier → deviations of positions (m), forces (N) and the object's position (m)."""
    return {tier: _deviations(tier) for tier in ("reference", "fast")}


def test_reference_tier_reproduces_every_instant(deviations):
    # Measured: 0.64 µm, 7.8 mN at one instant, 0.06 mN on average, 0.36 µm.
    q_m, f_n, y_m = deviations["reference"]
    assert q_m.max() <= 2e-6
    assert f_n.max() <= 0.03
    assert f_n.mean() <= 0.2e-3
    assert np.median(f_n, axis=(1, 2)).max() <= 0.5e-3  # a mean over six instants would be that of one contact point
    assert y_m.max() <= 2e-6


def test_fast_tier_stays_within_sensor_noise(deviations):
    # Measured: 0.16 mm, 68 mN at one instant, 2.4 mN on average, 0.06 mm.
    q_m, f_n, y_m = deviations["fast"]
    assert q_m.max() <= 0.2e-3
    assert f_n.max() <= 0.3
    assert f_n.mean() <= 3e-3
    assert y_m.max() <= 0.1e-3


def test_table_is_whole():
    assert len(EPISODES) == 41
    assert [row["episode"] for row in INSTANTS] == [episode["episode"] for episode in EPISODES for _ in STEPS]
    assert [int(row["step"]) for row in INSTANTS] == STEPS * 41
