"""How hard MuJoCo's contacts press at a depth and a speed, and at which depth they press as hard at another speed."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

# What MuJoCo clips impedances to.
_LEAST, _MOST = 1e-4, 0.9999
# A depth is sought until a step is as small as this, metres, or for so many steps.
_SMALL_M, _STEPS = 1e-6, 40


@dataclass(frozen=True, eq=False)
class ContactLaw:
    """The force of a side's contacts at depths r that grow by u, up to a factor: Σ d / (1 − d) · (k d r + b u).

    d is the impedance, which depends on the depth (``solimp``), k and b are stiffness and damping (``solref``). The sum
    in brackets is the acceleration that a contact aims at, less the one that the bodies have (MuJoCo's documentation,
    Computation, "Constraint model").

    Args:
      solref: of each row's contacts, ``(n, 2)``.
      solimp: likewise, ``(n, 5)``.
      behind: how much less deep than a row's deepest each of its contacts is, metres, ``(n, contacts)``; ∞ for none.
    """

    solref: np.ndarray
    solimp: np.ndarray
    behind: np.ndarray

    @functools.cached_property
    def damping(self) -> np.ndarray:
        """b, in 1/s, ``(n,)``."""
        first, second = self.solref.T
        return np.where(first > 0, 2 / np.where(first > 0, first, 1.0), -second) / self._largest

    @functools.cached_property
    def stiffness(self) -> np.ndarray:
        """k, in 1/s², ``(n,)``."""
        first, second = self.solref.T
        return np.where(first > 0, 1 / np.where(first > 0, first * second, 1.0) ** 2, -first) / self._largest**2

    def impedance(self, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """d at depths ``(n, contacts)``, and its slope, 1/m."""
        least, rise, width, middle, power = self._curve
        share = np.minimum(depth / width, 1.0)
        early = share <= middle
        end = np.where(early, middle, 1 - middle)
        of_end = np.where(early, share, 1 - share) / end
        steepness = of_end ** (power - 1)
        part = end * of_end * steepness
        slope = np.where(share < 1, rise / width * power * steepness, 0.0)
        return least + rise * np.where(early, part, 1 - part), slope

    def force(self, depth: np.ndarray, more: np.ndarray) -> np.ndarray:
        """Force at a depth of the deepest contact, ``(n,)``; ``more`` adds to k d r: b u, less what the bodies have."""
        return self._force(depth, more)[0]

    def depth(self, force: np.ndarray, more: np.ndarray, near: np.ndarray) -> np.ndarray:
        """Depth of the deepest contact at so much force, ``(n,)``, metres.

        0 at no force; next to 0 where ``more`` alone presses harder.

        Args:
          force: in units of :meth:`force`, ``(n,)``.
          more: as there, m/s², ``(n,)``.
          near: positive depths to begin from, metres, ``(n,)``.
        """
        found, low, high = np.array(near, float), np.zeros(len(near)), np.full(len(near), np.inf)
        done = np.zeros(len(near), bool)  # each row by itself, whatever the others need
        for _ in range(_STEPS):
            now, slope = self._force(found, more)
            short = now < force
            low, high = np.where(short, found, low), np.where(short, high, found)
            newton = found + (force - now) / np.where(slope > 0, slope, np.inf)
            inside = (newton > low) & (newton < np.minimum(high, 2 * found))
            better = np.where(inside, newton, np.where(high < np.inf, (low + high) / 2, 2 * found))
            before, found = found, np.where(done, found, better)
            done |= np.abs(found - before) < _SMALL_M
            if done.all():
                break
        return np.where(force > 0, found, 0.0)

    def _force(self, depth: np.ndarray, more: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Force and how it grows with the depth, each ``(n,)``."""
        each = depth[:, None] - self.behind
        inside = np.where(each > 0, each, 0.0)
        (d, slope), k = self.impedance(inside), self.stiffness[:, None]
        aim = k * d * inside + more[:, None]
        presses = (each > 0) & (aim > 0)
        force = np.where(presses, d / (1 - d) * aim, 0.0)
        growth = slope / (1 - d) ** 2 * aim + d / (1 - d) * k * (d + slope * inside)
        return force.sum(axis=1), np.where(presses, growth, 0.0).sum(axis=1)

    @functools.cached_property
    def _curve(self) -> list[np.ndarray]:
        """Least impedance, by how much it rises, over which depth, its middle and its power, each ``(n, 1)``."""
        least, _, width, middle, power = self.solimp.T
        least, middle = np.clip(least, _LEAST, _MOST), np.clip(middle, _LEAST, _MOST)
        return [one[:, None] for one in (least, self._largest - least, width, middle, np.maximum(power, 1.0))]

    @functools.cached_property
    def _largest(self) -> np.ndarray:
        return np.clip(self.solimp[:, 1], _LEAST, _MOST)
