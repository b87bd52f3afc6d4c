"""What distinguishes one grasp from another: the parameters that are drawn per episode."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from forcegrasp.short_repr import ShortRepr


@dataclass(frozen=True, repr=False)
class GraspParameters(ShortRepr):
    """The parameters of n grasps. Every field is a float64 array of shape ``(n,)``."""

    kappa: np.ndarray  #: softness κ; 0 hard, 1 soft
    b2: np.ndarray  #: servo gain that is drawn with every grasp; the velocity gain of the paper's gripper
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
