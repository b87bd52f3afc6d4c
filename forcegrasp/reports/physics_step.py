"""Whether a scene's physics steps are too long to tell what is missing, and which would do."""

from __future__ import annotations

from math import ceil, log2

from forcegrasp.diagnosis.result import Diagnosis
from forcegrasp.identify.cross_validation import rms
from forcegrasp.identify.noise_floor import beyond_fit
from forcegrasp.identify.verdict import Verdict

# Half a step may change what is foretold by this share of the noise, and with steps short enough by no more than that.
_TOO_LONG, _SHORT_ENOUGH = 0.33, 0.15


def shorter_step(diagnosis: Diagnosis) -> float | None:
    """The physics step with which a model would be simulated well enough to tell what it leaves, s.

    None if the scene's own is short enough, or nothing is left. An error of integration falls with the step.
    """
    if not diagnosis.numerical or not (diagnosis.left or diagnosis.verdict is Verdict.NOT_FITTED):
        return None
    of_half = _of_half(diagnosis)
    if of_half < _TOO_LONG:
        return None
    return step_of_scene(diagnosis) / 2 ** ceil(log2(of_half / _SHORT_ENOUGH))


def step_of_scene(diagnosis: Diagnosis) -> float:
    """The scene's own physics step, s."""
    return float(diagnosis.target.gripper.compile().opt.timestep)


def step_warning(diagnosis: Diagnosis) -> str:
    """What too long a step costs, and what to do; empty if it is short enough."""
    shorter = shorter_step(diagnosis)
    if shorter is None:
        return ""
    return (
        f"half the scene's physics step of {1e3 * step_of_scene(diagnosis):g} ms changes what the model foretells by"
        f" {_of_half(diagnosis):.2g} × noise: what is missing may hide behind that, or look like something else. With"
        f' <option timestep="{shorter:g}"/> in the scene it would be {_SHORT_ENOUGH:g} at most, as it falls with it'
    )


def _of_half(diagnosis: Diagnosis) -> float:
    """By how much half the step changes what is foretold, of what no parameter makes up for, ÷ noise."""
    return rms(beyond_fit(diagnosis.fit, diagnosis.numerical)[0], diagnosis.target)
