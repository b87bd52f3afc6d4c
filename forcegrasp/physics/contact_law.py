"""How hard MuJoCo's contacts press at a depth and a speed, and at which depth they press as hard at another speed."""

from __future__ import annotations

import numpy as np

# What MuJoCo clips impedances to.
_LEAST, _MOST = 1e-4, 0.9999
# A depth is sought until a step is as small as this, metres, or for so many steps.
_SMALL_M, _STEPS = 1e-6, 40


def contact_numbers(solref: np.ndarray, solimp: np.ndarray) -> np.ndarray:
    """What a :class:`ContactLaw` is made of, ``(n, 7)``, from MuJoCo's ``solref`` ``(n, 2)`` and ``solimp`` ``(n, 5)``.

    Damping b in 1/s, stiffness k in 1/s², least impedance, by how much it rises, over which depth, its middle, power.
    """
    (first, second), (least, most, width, middle, power) = solref.T, solimp.T
    least, most, middle = (np.clip(one, _LEAST, _MOST) for one in (least, most, middle))
    of_times = first > 0  # else they are stiffness and damping themselves
    damping = np.where(of_times, 2 / np.where(of_times, first, 1.0), -second) / most
    stiffness = np.where(of_times, 1 / np.where(of_times, first * second, 1.0) ** 2, -first) / most**2
    return np.stack([damping, stiffness, least, most - least, width, middle, np.maximum(power, 1.0)], axis=1)


class ContactLaw:
    """The force of a side's contacts at depths r that grow by u, up to a factor: Σ d / (1 − d) · (k d r + b u).

    d is the impedance, which depends on the depth (``solimp``), k and b are stiffness and damping (``solref``). The sum
    in brackets is the acceleration that a contact aims at, less the one that the bodies have (MuJoCo's documentation,
    Computation, "Constraint model").

    Args:
      numbers: of each row's contacts, from :func:`contact_numbers`, ``(n, 7)``.
      behind: how much less deep than a row's deepest each of its contacts is, metres, ``(n, contacts)``; ∞ for none.
    """

    def __init__(self, numbers: np.ndarray, behind: np.ndarray) -> None:
        self.behind = behind
        self.damping = numbers[:, 0]  #: b, in 1/s, ``(n,)``
        self._stiffness = numbers[:, 1:2]
        self._curve = [numbers[:, place : place + 1] for place in range(2, numbers.shape[1])]

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
        _, d, _, aim = self._aim(depth, more)
        return (d / (1 - d) * aim).sum(axis=1)

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
        inside, d, slope, aim = self._aim(depth, more)
        ratio = d / (1 - d)
        growth = slope / (1 - d) ** 2 * aim + ratio * self._stiffness * (d + slope * inside)
        return (ratio * aim).sum(axis=1), np.where(aim > 0, growth, 0.0).sum(axis=1)

    def _aim(self, depth: np.ndarray, more: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Each contact's depth, impedance with its slope, and k d r + ``more``, 0 where it does not press."""
        inside = np.maximum(depth[:, None] - self.behind, 0.0)
        d, slope = self.impedance(inside)
        aim = np.maximum(self._stiffness * d * inside + more[:, None], 0.0)
        return inside, d, slope, np.where(inside > 0, aim, 0.0)
