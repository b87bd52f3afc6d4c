"""What all steps of a search for missing effects share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from forcegrasp.diagnosis.leads import Leads
from forcegrasp.diagnosis.verdict import explained_share
from forcegrasp.identify.cross_validation import (
    heldout_residual,
    log_likelihood_of_sizes,
    rms,
    rms_of_recordings,
    to_check_with,
)
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.progress import Progress, silent
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target
from forcegrasp.replay.replay import Replay

# Fewer held-out recordings say nothing of how much they scatter.
_RECORDINGS = 3
# Below so many times the noise a recording has nothing to explain.
_SHOWS = 1.5


@dataclass(frozen=True, eq=False)
class Few:
    """Some grasps of a set."""

    keep: np.ndarray  #: their indices
    simulators: Simulators  #: of them
    rough: Replay  #: of them, for what only ranks


@dataclass(frozen=True, eq=False)
class Study:
    """The measurements, and what they are simulated and judged with."""

    target: Target
    simulators: Simulators
    folds: Sequence[np.ndarray]  #: indices of the grasps that are held out together
    numerical: Sequence[np.ndarray] = ()  #: the model's own numerical errors, which no effect gets credit for
    progress: Progress = silent
    few: Few | None = None  #: grasps that stand for all where a rough answer will do; none are chosen by default
    rough: Replay | None = None  #: simulates what only ranks; the cheap one by default
    #: whether what the set gives, moved within its tolerance, explains what a fit leaves; not asked by default
    given_explains: Callable[[Target, Fit], bool] = lambda _target, _fit: False
    leads: Leads = field(default_factory=Leads)  #: fits with one more effect, until they are judged

    def heldout(self, fit: Fit) -> np.ndarray:
        """Residuals of held-out grasps, ``(G, S, C)``."""
        return heldout_residual(fit, self.target, self.folds)

    def telling(self, words: str, task: Callable[[], Fit], without: Fit) -> Callable[[], Fit]:
        """A task that ends by telling how much error its fit leaves, and by taking it down as a lead.

        Args:
          words: what is fitted.
          task: fits with one more effect.
          without: the fit without it.
        """

        def told() -> Fit:
            fit = task()
            before, after = (rms(one.residual, self.target) for one in (without, fit))
            self.progress(f"{words}: {before:.2f} → {after:.2f} × noise")
            self.leads.add(fit, without, before, after, len(self.target.grasps))
            return fit

        return told

    def on_few(self, fit: Fit) -> tuple[Study, Fit]:
        """The few grasps alone, none of them held out, and what a fit says of them; all where none are chosen."""
        if self.few is None:
            return self, fit
        keep, target = self.few.keep, self.target.subset(self.few.keep)
        numerical = tuple(one[keep][:, : target.mask.shape[1]] for one in self.numerical)
        few = Study(target, self.few.simulators, (), numerical, self.progress, rough=self.few.rough, leads=self.leads)
        return few, fit.subset(keep)

    def error(self, residual: np.ndarray) -> float:
        """Root mean square of residuals ÷ noise ``(G, S, C)`` of held-out grasps, of those marked to check with if any
        are."""
        check = to_check_with(self.target.grasps)
        if len(check):
            residual = np.where(np.isin(np.arange(len(residual)), check)[:, None, None], residual, np.nan)
        return rms(residual, self.target)

    def gains(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """By how much each grasp's held-out log-likelihood rises, ``(G,)``; NaN of those that were not held out.

        Args:
          before: residuals of held-out grasps under one fit, ``(G, S, C)``.
          after: the same under another.
        """
        gains = log_likelihood_of_sizes(after, self.target) - log_likelihood_of_sizes(before, self.target)
        gains[~np.isfinite(before).any(axis=(1, 2))] = np.nan
        return gains

    def explained(self, before: np.ndarray, after: np.ndarray) -> float:
        """Share of the mean square beyond the noise by which residuals of held-out grasps fall.

        Of three recordings or more it is the share in most of them, if that is larger: where one motion shows what is
        not known, it must not hide what explains the others.

        Args:
          before: under one fit, ``(G, S, C)``.
          after: the same under another.
        """
        all_together = explained_share(rms(before, self.target), rms(after, self.target))
        left = rms_of_recordings(after, self.target)
        errors = {name: error for name, error in rms_of_recordings(before, self.target).items() if error > _SHOWS}
        each = [explained_share(error, left[name]) for name, error in errors.items()]
        return max(all_together, float(np.median(each))) if len(each) >= _RECORDINGS else all_together

    def of_recordings(self, gains: np.ndarray) -> list[np.ndarray]:
        """The gains ``(G,)`` of the windows of each recording that was held out; none if they are fewer than three."""
        held = [gains[members][np.isfinite(gains[members])] for members in self.target.recordings.values()]
        held = [one for one in held if len(one)]
        return held if len(held) >= _RECORDINGS else []
