"""Where motors stand as a log begins: at their command, wherever noise and an encoder have them; or on the way."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.measure import MeasuredGrasp
from forcegrasp.replay.start import encoder_noise, start_position

OPEN_M, SIGMA = 0.045, 3e-5
TIME = np.arange(20) * 0.04


def grasp(position: np.ndarray, command: tuple[float, float], held: int = 20) -> MeasuredGrasp:
    """Positions ``(20, 2)`` or ``(2,)``; after so many samples another command follows."""
    position = np.broadcast_to(position, (len(TIME), 2)).copy()
    commands = np.tile(np.array(command), (len(TIME), 1))
    commands[held:] -= 0.001
    return MeasuredGrasp("g", "o", "", None, None, None, TIME, commands, position, 0 * position, None)


def start(position: np.ndarray | tuple[float, float], command: tuple[float, float], held: int = 20) -> list[float]:
    return start_position(grasp(np.array(position), command, held), OPEN_M, np.full(2, SIGMA)).tolist()


def test_where_fingers_that_rest_start():
    assert start((0.0301, 0.0303), (0.030, 0.0305)) == [0.030, 0.0305]  # at the command but for noise
    assert start((0.0448, 0.0452), (0.030, 0.030)) == [OPEN_M, OPEN_M]  # open
    assert start((0.040, 0.035), (0.030, 0.030)) == [0.040, 0.035]  # on the way
    assert start((0.046, -0.002), (0.010, 0.010)) == [OPEN_M, 0.0]  # within its range
    assert start((0.0302, 0.0451), (0.030, 0.020)) == [0.030, OPEN_M]  # each finger by itself
    assert start((0.0443, 0.0448), (0.0444, 0.0444)) == [0.0444, OPEN_M]  # at the nearer one, near to both


@pytest.mark.parametrize(("held", "seen"), [(20, True), (6, True), (5, False)])
def test_a_finger_that_is_seen_to_go_to_its_command(held, seen):
    """By 0.3 mm, and the other one by noise alone; at the open end, too, beyond which a joint may go."""
    away = np.stack([3e-4 * np.exp(-TIME / 0.05), 2 * SIGMA * (TIME == 0)], axis=1)
    assert start(0.030 + away, (0.030, 0.030), held) == [0.0303 if seen else 0.030, 0.030]
    assert start(OPEN_M + away, (OPEN_M, OPEN_M), held) == pytest.approx([OPEN_M + 3e-4 * seen, OPEN_M])


def test_a_finger_that_leaves_the_open_end_stood_there():
    """However its encoder is off: it is not near its command."""
    leaving = np.stack([0.0448 - 0.014 * (1 - np.exp(-TIME / 0.1))] * 2, axis=1)
    assert start(leaving, (0.030, 0.030)) == [OPEN_M, OPEN_M]


def test_noise_of_encoders():
    rng = np.random.default_rng(0)
    motion = 0.03 + 0.01 * np.sin(TIME)[:, None]
    grasps = [
        grasp(motion + np.array([SIGMA, 3 * SIGMA]) * rng.standard_normal((20, 2)), (0.03, 0.03)) for _ in range(40)
    ]
    assert encoder_noise(grasps) == pytest.approx([SIGMA, 3 * SIGMA], rel=0.1)
    assert encoder_noise([grasp(np.array((0.03, 0.03)), (0.03, 0.03))]).tolist() == [0.0, 0.0]


def test_one_step_of_a_rounded_encoder_is_no_motion():
    """Fingers rest, one step from what is read first, and a few other grasps go slowly through many steps."""
    read = np.where(TIME < 0.06, 0.0301, 0.030)
    resting = grasp(np.stack([read, read], axis=1), (0.030, 0.030))
    going = [grasp(0.030 - 1e-4 * ((np.arange(40).reshape(20, 2) + i) // 4), (0.030, 0.030)) for i in range(4)]
    noise = encoder_noise([*[resting] * 12, *going])
    assert noise == pytest.approx(1e-4 / np.sqrt(12), rel=1e-3)
    assert start_position(resting, OPEN_M, noise).tolist() == [0.030, 0.030]
    assert start_position(resting, OPEN_M, np.zeros(2)).tolist() == [0.0301, 0.0301]
