"""Effects that promise most so far: fits with one more effect that nothing has been held against yet."""

from __future__ import annotations

from dataclasses import dataclass, field

from forcegrasp.diagnosis.verdict import LEAST_SHARE, explained_share
from forcegrasp.identify.fit import Fit

# So many are told.
_TOLD = 3


@dataclass(frozen=True)
class Lead:
    """What one more effect does to the error of the grasps that it was fitted to."""

    effect: str  #: its name
    grasps: int  #: that it was fitted to: few of the set, or all
    error_before: float  #: rms residual of these ÷ noise without it
    error_after: float  #: and with it

    @property
    def share(self) -> float:
        """Share of the mean square beyond the noise that it explains."""
        return explained_share(self.error_before, self.error_after)


@dataclass(eq=False)
class Leads:
    """All fits with one more effect that a search has made."""

    _all: list[tuple[frozenset[str], Lead]] = field(default_factory=list)

    def add(self, fit: Fit, without: Fit, before: float, after: float, grasps: int) -> None:
        """Takes down a fit.

        Args:
          fit: with one more effect.
          without: of the same grasps, without it.
          before, after: rms residual ÷ noise without it, and with it.
          grasps: how many they are.
        """
        for name in _names(fit) - _names(without):
            self._all.append((_names(without), Lead(name, grasps, before, after)))

    def beside(self, fit: Fit) -> tuple[Lead, ...]:
        """The best of those that go on from this fit, what explains most first; each effect once.

        Of an effect the fit to most grasps counts, and of those the last, which was brought nearest to its end.
        """
        furthest: dict[str, Lead] = {}
        known_effects = _names(fit)
        for one in (lead for beside, lead in self._all if beside == known_effects):
            known = furthest.get(one.effect)
            if known is None or one.grasps >= known.grasps:
                furthest[one.effect] = one
        worth_telling = [one for one in furthest.values() if one.share >= LEAST_SHARE]
        return tuple(sorted(worth_telling, key=lambda one: -one.share)[:_TOLD])


def _names(fit: Fit) -> frozenset[str]:
    return frozenset(one.effect.name for one in fit.effects)
