"""What encoders that read wrongly have in common: only the log is off, or the servo acts on what they say."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect


class WrongEncoder(Effect):
    """Positions are read as :meth:`read_position` has them, by the log alone or by the servo, too."""

    stage = "sensor"
    family = "offset"
    variants = ("reading", "loop")
    known_beforehand = ("loop",)
    variant_needs = {"loop": "position loop"}  # noqa: RUF012 never changed
    per = "motor"

    @classmethod
    def reads_only(cls, variant: str = "") -> bool:
        return variant != "loop"

    def true_position(self, read: np.ndarray) -> np.ndarray:
        """Where motors stand by what their encoders read, m or rad, ``(rows, motors)``."""
        raise NotImplementedError

    def rests_at(self, command: np.ndarray) -> np.ndarray:
        return self.true_position(command) if self.variant == "loop" else command

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        return self.rests_at(command)
