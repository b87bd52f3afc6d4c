"""Whether a scene's physics steps are too long to tell what is missing, and which would do."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, log2

import numpy as np

from forcegrasp.diagnosis.result import Diagnosis
from forcegrasp.identify.cross_validation import rms
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.noise_floor import beyond_fit
from forcegrasp.identify.target import Target
from forcegrasp.identify.verdict import Verdict
from forcegrasp.physics.gripper import Gripper

# Half a step may change what is foretold by this share of the noise, and with steps short enough by no more than that.
_TOO_LONG, _SHORT_ENOUGH = 0.33, 0.15


def shorter_step(diagnosis: Diagnosis) -> float | None:
    """The physics step with which a model would be simulated well enough to tell what it leaves, s.

    None if the scene's own is short enough, or nothing is left. An error of integration falls with the step.
    """
    if not diagnosis.numerical or not (diagnosis.left or diagnosis.verdict is Verdict.NOT_FITTED):
        return None
    of_half = _of_half(diagnosis.fit, diagnosis.target, diagnosis.numerical)
    if of_half < _TOO_LONG:
        return None
    return short_enough(step_of_scene(diagnosis.target.gripper), of_half)


def short_enough(step_s: float, of_half: float) -> float:
    """The physics step, s, with which half of it would change next to nothing of what is foretold.

    Args:
      step_s: the scene's own.
      of_half: what half of that changes, ÷ noise.
    """
    return step_s / 2 ** max(1, ceil(log2(of_half / _SHORT_ENOUGH)))


def step_of_scene(gripper: Gripper) -> float:
    """The scene's own physics step, s."""
    return float(gripper.compile().opt.timestep)


def step_warning(diagnosis: Diagnosis) -> str:
    """What too long a step costs, and what to do; empty if it is short enough."""
    if shorter_step(diagnosis) is None:
        return ""
    return warning_of_fit(diagnosis.fit, diagnosis.target, diagnosis.numerical)


def warning_of_fit(fit: Fit, target: Target, numerical: Sequence[np.ndarray]) -> str:
    """The same of a fit that did not converge; empty if its steps are short enough."""
    of_half = _of_half(fit, target, numerical)
    if of_half < _TOO_LONG:
        return ""
    step_s = step_of_scene(target.gripper)
    return (
        f"half the scene's physics step of {1e3 * step_s:g} ms changes what the model foretells by {of_half:.2g} ×"
        " noise: what is missing may hide behind that, or look like something else. With"
        f' <option timestep="{short_enough(step_s, of_half):g}"/> in the scene it would be {_SHORT_ENOUGH:g} at most,'
        " as it falls with it"
    )


def _of_half(fit: Fit, target: Target, numerical: Sequence[np.ndarray]) -> float:
    """By how much half the step changes what is foretold, of what no parameter makes up for, ÷ noise."""
    return rms(beyond_fit(fit, numerical)[0], target)
