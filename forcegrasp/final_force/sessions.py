"""What repeated squeezes tell: the noise of a force, and whether a session reads more than another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import f, t

from forcegrasp.short_repr import ShortRepr

#: Repeats that an estimate of the noise needs.
LEAST_REPEATS = 4
#: Probability below which sessions are said to differ.
SHIFT_ALARM = 0.05


@dataclass(frozen=True, repr=False)
class Shift(ShortRepr):
    """How much more forces read in one session than in the first, at the same object and delta, newtons."""

    session: str
    value: float
    low: float  #: of the 95 % interval
    high: float
    squeezes: int  #: of this session that another session has, too


@dataclass(frozen=True, repr=False)
class Repeats(ShortRepr):
    """Squeezes of the same object by the same delta: twice in a session, or in several sessions."""

    freedom: int  #: repeats that remain for the noise
    noise_n: float  #: standard deviation of a force among them, shifts taken out; NaN without repeats
    shifts: tuple[Shift, ...] = ()  #: of the sessions after the first, as far as common squeezes tell them
    untold: tuple[str, ...] = ()  #: sessions that share no squeeze with the first, not even by way of others
    p: float | None = None  #: probability of shifts this large if sessions read alike; None if that can't be told

    @property
    def shifted(self) -> bool:
        """Whether sessions differ by more than chance."""
        return self.p is not None and self.p < SHIFT_ALARM

    def correction(self, sessions: Sequence[str]) -> np.ndarray:
        """What to take off forces of these sessions to make them like the first one's, ``(n,)``; 0 if alike."""
        known = {shift.session: shift.value for shift in self.shifts} if self.shifted else {}
        return np.array([known.get(session, 0.0) for session in sessions])


def repeats_of(
    objects: Sequence[str], delta_m: np.ndarray, force_n: np.ndarray, sessions: Sequence[str] = ()
) -> Repeats:
    """Two-way analysis of variance: force = that of its object and delta + shift of its session + noise.

    No shape of the curve is assumed. Only squeezes that were repeated count.
    """
    named = np.array(sessions) if len(sessions) else np.full(len(force_n), "")
    later_names = list(dict.fromkeys(named.tolist()))[1:]
    pairs = list(zip(objects, np.round(delta_m, 9).tolist(), strict=True))
    places = {pair: index for index, pair in enumerate(dict.fromkeys(pairs))}
    cells = np.array([places[pair] for pair in pairs])
    force = np.asarray(force_n, float).copy()
    later = (named[:, None] == np.array(later_names, named.dtype)).astype(float)
    for cell in np.unique(cells):
        force[cells == cell] -= force[cells == cell].mean()
        later[cells == cell] -= later[cells == cell].mean(axis=0)
    rank = int(np.linalg.matrix_rank(later)) if later.size else 0
    freedom = len(force) - len(np.unique(cells)) - rank
    found = np.linalg.pinv(later) @ force
    left = float(np.sum((force - later @ found) ** 2))
    noise = float(np.sqrt(left / freedom)) if freedom > 0 else float("nan")
    # a session is told from the first where its shift alone lies in the space that the common squeezes span
    told = np.abs(np.linalg.pinv(later) @ later - np.eye(len(later_names))).max(axis=1, initial=0.0) < 1e-6
    untold = tuple(name for name, known in zip(later_names, told, strict=True) if not known)
    if freedom < LEAST_REPEATS or not told.any():
        return Repeats(freedom, noise, untold=untold)
    errors = noise * np.sqrt(np.diag(np.linalg.pinv(later.T @ later))) * t.ppf(0.975, freedom)
    common = [
        int(np.count_nonzero((np.abs(later[:, k]) > 1e-12) & (named == name))) for k, name in enumerate(later_names)
    ]
    shifts = tuple(
        Shift(name, float(value), float(value - error), float(value + error), squeezes)
        for name, value, error, squeezes, known in zip(later_names, found, errors, common, told, strict=True)
        if known
    )
    explained = (float(np.sum(force**2)) - left) / rank
    p = float(f.sf(explained / max(noise**2, 1e-18), rank, freedom))
    return Repeats(freedom, noise, shifts, untold, p)
