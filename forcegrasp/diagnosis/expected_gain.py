"""How much a grasp is expected to tell about which of two rival effects is right, in bits."""

from __future__ import annotations

import numpy as np

# Readings that are drawn from each rival: the mean of so many has a standard error below 0.01 bit.
_DRAWS = 4000


def expected_bits(difference: np.ndarray, one: np.ndarray, other: np.ndarray) -> float:
    """Mutual information of the readings and of which of two equally probable rivals is right: 0 to 1 bit.

    Each rival predicts a normal distribution of the readings: noise of 1, and what the uncertainty of its parameters
    adds, for what a rival can make up for by other parameters tells nothing. This is the expected logarithm of
    (posterior ÷ prior probability) of the rival that is right (Lindley 1956), not the Kullback–Leibler divergence of
    the two, which has no bound. Two normal distributions have no closed form of it; it is the mean over draws from
    both, in the few directions in which they differ.

    Args:
      difference: of the rivals' predictions ÷ noise, ``(N,)``.
      one: change of one rival's predictions ÷ noise by one standard deviation of its parameters, in directions that
        are independent of each other, ``(N, p)``.
      other: the same of the other rival, ``(N, q)``.
    """
    axes = np.linalg.qr(np.column_stack([difference, one, other]))[0]
    means = [np.zeros(axes.shape[1]), axes.T @ difference]
    roots = [np.linalg.cholesky(np.eye(axes.shape[1]) + (s := axes.T @ spread) @ s.T) for spread in (one, other)]
    rng = np.random.default_rng(0)
    lost = []
    for right in (0, 1):
        drawn = means[right] + rng.standard_normal((_DRAWS, axes.shape[1])) @ roots[right].T
        likelihoods = [_log_likelihood(drawn - mean, root) for mean, root in zip(means, roots, strict=True)]
        lost.append(np.logaddexp(0.0, likelihoods[1 - right] - likelihoods[right]).mean())
    return float(np.clip(1.0 - np.mean(lost) / np.log(2), 0.0, 1.0))


def _log_likelihood(off: np.ndarray, root: np.ndarray) -> np.ndarray:
    """Of readings that are so far off, ``(draws, N)``, up to a constant; ``root`` is that of the covariance."""
    return -0.5 * np.sum(np.linalg.solve(root, off.T) ** 2, axis=0) - np.log(np.diag(root)).sum()
