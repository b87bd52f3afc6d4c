"""What a grasp is expected to tell about two rivals, held against one-dimensional integrals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from forcegrasp.diagnosis.expected_gain import expected_bits


def integrated(distance: float, wide: float = 1.0, wider: float = 1.0) -> float:
    """Entropy of the mixture of two normal distributions less the mean entropy of the two, bits."""
    one, other = norm(0, wide), norm(distance, wider)

    def density(x: float) -> float:
        p, q = one.pdf(x), other.pdf(x)
        mean = (p + q) / 2
        return sum(0.5 * part * np.log2(part / mean) for part in (p, q) if part > 0)

    return quad(density, -60, 60, points=[0, distance], limit=400)[0]


@pytest.mark.parametrize("distance", [0.3, 1.0, 2.0, 4.0])
def test_without_uncertain_parameters_the_distance_alone_counts(distance):
    difference = np.full(16, distance / 4)
    nothing = np.zeros((16, 1))
    assert expected_bits(difference, nothing, nothing) == pytest.approx(integrated(distance), abs=0.02)


def test_nothing_and_all():
    nothing = np.zeros((5, 2))
    assert expected_bits(np.zeros(5), nothing, nothing) == pytest.approx(0, abs=1e-9)
    assert expected_bits(np.full(5, 30.0), nothing, nothing) == pytest.approx(1, abs=1e-9)


def test_what_a_rival_can_make_up_for_tells_little():
    """A difference of 6 × noise, in a direction in which either rival's parameters leave ±8, or ±8 and ±2."""
    difference = np.array([6.0, 0.0, 0.0])
    along, across = np.array([[8.0], [0.0], [0.0]]), np.array([[0.0], [8.0], [0.0]])
    wide = np.hypot(1, 8)
    assert expected_bits(difference, along, along) == pytest.approx(integrated(6, wide, wide), abs=0.02)
    assert expected_bits(difference, along, along / 4) == pytest.approx(integrated(6, wide, np.hypot(1, 2)), abs=0.02)
    assert expected_bits(difference, across, across) > 0.98
    assert expected_bits(difference, along, along) < 0.1


def test_parameters_that_two_rivals_have_in_common_are_no_difference():
    spread = np.array([[3.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    assert expected_bits(np.zeros(3), spread, spread) == pytest.approx(0, abs=1e-9)
