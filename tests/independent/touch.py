"""Effects between pad and object, and between object and table. Forces in the motors' newtons, before f_alpha."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .effect import DryFriction, Effect
from .scene import STEP_S


@dataclass
class StiffeningContact(Effect):
    """A second, hardening spring in the pad: force ∝ depth³ on top of the base contact."""

    at_one_mm: float = 0.0  # N

    def press(self, s):
        return self.at_one_mm * (np.maximum(s.depth, 0.0) / 1e-3) ** 3


@dataclass
class ViscoelasticContact(Effect):
    """A Maxwell branch beside the contact: spring and dashpot in series, which together only push."""

    stiffness: float = 0.0  # N/m
    relaxation: float = 0.6  # s

    def start(self, n, rng):
        self._branch, self._depth = np.zeros((n, 2)), np.zeros((n, 2))

    def press(self, s):
        depth = np.maximum(s.depth, 0.0)
        branch = self._branch * np.exp(-STEP_S / self.relaxation) + self.stiffness * (depth - self._depth)
        self._branch, self._depth = np.where(depth > 0, np.maximum(branch, 0.0), 0.0), depth
        return self._branch


@dataclass
class Adhesion(Effect):
    """A tacky pad: pulls with constant force once it has touched, until it is torn ``reach`` off the object."""

    pull: float = 0.0  # N
    reach: float = 2e-4  # m

    def start(self, n, rng):
        self._bonded = np.zeros((n, 2), bool)

    def press(self, s):
        self._bonded = (s.depth > 0) | (self._bonded & (s.depth > -self.reach))
        return -self.pull * np.where(self._bonded, np.clip(1.0 + s.depth / self.reach, 0.0, 1.0), 0.0)


@dataclass
class ContactFriction(Effect):
    """Objects that slide more easily, or less, wherever they are touched."""

    share: float = 1.0

    def mu(self, friction):
        return self.share * friction


@dataclass
class ObjectFriction(Effect):
    """Dry friction under the object, besides the floor's drag; acts at its middle, so it does not tip."""

    level: float = 0.0  # N

    def start(self, n, rng):
        self._friction = DryFriction((n,), 0.4)

    def table(self, s):
        return self._friction(s.ov, self.level)
