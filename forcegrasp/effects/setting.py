"""An effect with the values of its parameters: what is simulated, fitted, found and written down."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forcegrasp.effects.base import Effect
from forcegrasp.short_repr import ShortRepr


@dataclass(frozen=True, eq=False, repr=False)
class EffectSetting(ShortRepr):
    """An effect in one of its variants, and how strong it is."""

    effect: type[Effect]
    variant: str
    values: np.ndarray  #: of its parameters, ``(parameters,)``; ``(rows, parameters)`` where rows differ

    @classmethod
    def typical(cls, effect: type[Effect], variant: str = "") -> EffectSetting:
        """An effect of a size worth noticing, by default in its first variant."""
        return cls(effect, variant or effect.variants[0], effect.typical_values())

    @property
    def kind(self) -> tuple[type[Effect], str]:
        """The effect and its variant, whatever the values."""
        return self.effect, self.variant

    @property
    def title(self) -> str:
        """Name and variant, for people."""
        return f"{self.effect.name} ({self.variant})" if self.variant else self.effect.name

    @property
    def parameters(self) -> dict[str, float]:
        """The values by name."""
        return dict(zip((p.name for p in self.effect.parameters), map(float, self.values), strict=True))
