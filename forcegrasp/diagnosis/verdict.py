"""What a diagnosis concludes from the steps of its search, and from how much of the error they leave."""

from __future__ import annotations

from collections.abc import Sequence

from forcegrasp.identify.verdict import Verdict

#: An effect must explain this share of the mean square beyond the noise.
LEAST_SHARE = 0.25
#: Effects must explain this share of the mean square beyond the noise to be the answer; below it is "unknown".
EXPLAINED = 0.5
#: Where more than so many times the floor is left, they must explain this share of it: a look-alike takes half.
FAR, EXPLAINED_FAR = 2.0, 0.9
#: Where none of several explains half, all together must explain this share: two look-alikes take three quarters.
EXPLAINED_TOGETHER = 0.8
#: An effect that explains less than this share of what another does, and not all that is left, may be that one's form.
LITTLE = 0.05
#: Where an answer leaves more than so many times the floor, what is still missing may have decided between rivals.
MUCH = 1.5


def explained_share(before: float, after: float, noise: float = 1.0) -> float:
    """Share of the mean square beyond the noise that is gone.

    Args:
      before: rms error ÷ the assumed noise.
      after: the same afterwards.
      noise: the noise as it turned out ÷ the assumed noise.
    """
    return (before**2 - after**2) / max(before**2 - noise**2, 1e-9)


def explains_enough(
    share: float, after: float, floor: float, whole_recordings: bool, largest: float | None = None
) -> bool:
    """Whether what explains this share is an answer, and no look-alike.

    Args:
      share: of the mean square beyond the noise.
      after: held-out error ÷ noise that is left.
      floor: what noise and the simulation's own error leave.
      whole_recordings: whether motions were held out as wholes, to which a look-alike carries over less.
      largest: share that the effect explains by which the error falls most; all of it by default.
    """
    if whole_recordings:
        return share >= EXPLAINED
    if after > FAR * floor:
        return share >= EXPLAINED_FAR
    of_several = largest is not None and largest < EXPLAINED
    return share >= (EXPLAINED_TOGETHER if of_several else EXPLAINED)


def conclude(
    found: Sequence[Verdict],
    share: float,
    after: float,
    floor: float,
    left: bool,
    only_of_set: bool = False,
    whole_recordings: bool = False,
    largest: float | None = None,
) -> Verdict:
    """The verdict: that of the weakest step, if what was found explains enough.

    Args:
      found: verdicts of the steps that found something.
      share: of the mean square beyond the noise that their effects explain.
      after: held-out error ÷ noise that they leave.
      floor: what noise and the simulation's own error leave.
      left: whether something is left that is neither.
      only_of_set: whether all that was found is of the set, and not of the gripper.
      whole_recordings, largest: as for :func:`explains_enough`.
    """
    if not found:
        return Verdict.UNKNOWN if left else Verdict.EXPLAINED
    if left and not explains_enough(share, after, floor, whole_recordings, largest):
        return Verdict.UNKNOWN
    if Verdict.ONE_OF in found:
        return Verdict.ONE_OF
    return Verdict.DATA if only_of_set else Verdict.EFFECT
