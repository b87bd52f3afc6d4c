"""What the simulation asks of an effect; :mod:`forcegrasp.effects` builds on the plant, and not the other way round."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

#: Memory of an effect by name, each array with a row for each of the effect's rows.
State = dict[str, np.ndarray]


class Contribution(NamedTuple):
    """What an effect adds to one physics step, on its rows; None adds nothing."""

    friction: np.ndarray | None = None  #: dry friction of the motors, N or N·m, ``(rows, motors)``
    pad_shift_m: np.ndarray | None = None  #: displacement of the pads towards opening, ``(rows, 2)``
    finger_push_n: np.ndarray | None = None  #: force on the pads, positive opens, ``(rows, 2)``
    object_push_n: np.ndarray | None = None  #: force on the object along the grasp axis, ``(rows,)``
    damping: np.ndarray | None = None  #: viscous friction of the motors, N·s/m or N·m·s/rad, ``(rows, motors)``
    motor_push: np.ndarray | None = None  #: force on the motors besides their own, N or N·m, ``(rows, motors)``
    #: How much further MuJoCo's contacts have to find the pads, to press as pads at another speed do, ``(rows, 2)``.
    contact_shift_m: np.ndarray | None = None
    velocity_change: np.ndarray | None = None  #: of the motors, at once, m/s or rad/s, ``(rows, motors)``
    inertia: np.ndarray | None = None  #: of the motors, besides their own, kg or kg·m², ``(rows, motors)``


class PlantEffect(Protocol):
    """Acts on some rows of a plant; :class:`forcegrasp.effects.base.Effect` says what each hook takes and returns."""

    acts_alike: ClassVar[bool]
    after_noise: ClassVar[bool]
    follows_motion: ClassVar[bool]
    rows: np.ndarray

    @property
    def state(self) -> State: ...
    @property
    def rank(self) -> tuple[int, int]: ...
    @property
    def is_known_beforehand(self) -> bool: ...
    @classmethod
    def hooks(cls) -> set[str]: ...
    @classmethod
    def reads(cls) -> bool: ...
    def attach(self, plant: Any, rows: np.ndarray) -> PlantEffect: ...
    def reset(self, which: np.ndarray) -> None: ...
    def change_model(self, plant: Any, which: np.ndarray) -> None: ...
    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray: ...
    def motor_range(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]: ...
    def act(self) -> Contribution: ...
    def interaction(self, force: np.ndarray) -> np.ndarray: ...
    def motor_position(self, joint: np.ndarray) -> np.ndarray: ...
    def read_force(self, force: np.ndarray) -> np.ndarray: ...
    def read_position(self, position: np.ndarray) -> np.ndarray: ...
