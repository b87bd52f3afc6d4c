"""What distinguishes one grasp from another: the parameters that are drawn per episode."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np

from forcegrasp.short_repr import ShortRepr

Numbers = TypeVar("Numbers", float, np.ndarray)

#: Interval of the solver impedance width ρ, hard to soft (paper, Sec. 3). Metres.
RHO_RANGE_M = (0.003, 0.010)
#: Interval of the force scale f_α, soft to hard (paper, Sec. 3).
FORCE_SCALE_RANGE = (0.5, 5.0)
#: Force that a pad reads at the largest position delta of 3 mm, before f_α. Newtons (measured).
MAX_FORCE_N = 0.30


def rho_of_kappa(kappa: Numbers) -> Numbers:
    """Impedance width ρ in metres, growing linearly with softness κ (paper, Sec. 3)."""
    hard, soft = RHO_RANGE_M
    return hard + kappa * (soft - hard)


def force_scale_of_kappa(kappa: Numbers) -> Numbers:
    """Force scale f_α, falling linearly with softness κ (paper, Sec. 3)."""
    soft, hard = FORCE_SCALE_RANGE
    return soft + (1 - kappa) * (hard - soft)


def kappa_of_force_scale(force_scale: np.ndarray | float) -> np.ndarray:
    """Softness κ whose f_α is nearest: the inverse of :func:`force_scale_of_kappa`, within [0, 1]."""
    soft, hard = FORCE_SCALE_RANGE
    return np.clip(1 - (force_scale - soft) / (hard - soft), 0.0, 1.0)


@dataclass(frozen=True, repr=False)
class GraspParameters(ShortRepr):
    """The parameters of n grasps. Every field is a float64 array of shape ``(n,)``."""

    kappa: np.ndarray  #: softness κ; 0 hard, 1 soft
    b2: np.ndarray  #: velocity gain of the actuators
    radius_m: np.ndarray  #: object radius (the paper's w_o)
    offset_m: np.ndarray  #: object position along the grasp axis, o_y
    goal_force_n: np.ndarray  #: goal force per finger, f_goal

    def __post_init__(self) -> None:
        arrays = np.broadcast_arrays(*(np.atleast_1d(np.asarray(getattr(self, f.name), float)) for f in fields(self)))
        for entry, array in zip(fields(self), arrays, strict=True):
            object.__setattr__(self, entry.name, np.array(array))

    def __len__(self) -> int:
        return len(self.kappa)

    def __getitem__(self, index: Any) -> GraspParameters:
        return GraspParameters(*(np.atleast_1d(getattr(self, f.name)[index]) for f in fields(self)))

    @property
    def rho_m(self) -> np.ndarray:
        """Solver impedance width ρ, shape ``(n,)``."""
        return rho_of_kappa(self.kappa)

    @property
    def force_scale(self) -> np.ndarray:
        """Force scale f_α, shape ``(n,)``."""
        return force_scale_of_kappa(self.kappa)

    def as_array(self) -> np.ndarray:
        """All parameters as columns, in the order of the fields, shape ``(n, 5)``."""
        return np.stack([getattr(self, f.name) for f in fields(self)], axis=1)

    @classmethod
    def from_array(cls, array: np.ndarray) -> GraspParameters:
        """The inverse of :meth:`as_array`."""
        return cls(*np.asarray(array, float).T)

    @classmethod
    def concatenate(cls, parts: list[GraspParameters]) -> GraspParameters:
        """Joins several sets of grasps, in order."""
        return cls.from_array(np.concatenate([part.as_array() for part in parts]))

    def describe(self, index: int) -> str:
        """One grasp in words, for messages."""
        return ", ".join(f"{f.name}={getattr(self, f.name)[index]:.6g}" for f in fields(self))
