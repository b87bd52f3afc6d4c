"""What a diagnosis concludes from the steps of its search, and from how much of the error they leave."""

from __future__ import annotations

from collections.abc import Sequence

#: Effects must explain this share of the mean square beyond the noise to be the answer; below it is "unknown".
EXPLAINED = 0.5
#: Where more than so many times the floor is left, they must explain this share of it: a look-alike takes half.
FAR, EXPLAINED_FAR = 2.0, 0.9
#: An answer that leaves more than so many times the floor says so first.
MUCH = 1.5


def explained_share(before: float, after: float, noise: float = 1.0) -> float:
    """Share of the mean square beyond the noise that is gone.

    Args:
      before: rms error ÷ the noise that was said.
      after: the same afterwards.
      noise: the noise as it turned out ÷ the noise that was said.
    """
    return (before**2 - after**2) / max(before**2 - noise**2, 1e-9)


def conclude(found: Sequence[str], before: float, after: float, floor: float, left: bool) -> str:
    """The verdict: that of the weakest step, if what was found explains enough.

    Args:
      found: verdicts of the steps that found something.
      before: held-out error ÷ noise without their effects.
      after: the same with them.
      floor: what noise and the simulation's own error leave.
      left: whether something is left that is neither.
    """
    if not found:
        return "unknown" if left else "explained"
    enough = EXPLAINED_FAR if after > FAR * floor else EXPLAINED
    if left and explained_share(before, after) < enough:
        return "unknown"
    return "one_of" if "one_of" in found else "effect"
