"""Whether a fit had stalled that an effect was added to: from where one with the effect has led, it leaves less."""

from __future__ import annotations

import numpy as np

from forcegrasp.diagnosis.families import problem_without
from forcegrasp.diagnosis.search.refine import NO_BETTER
from forcegrasp.diagnosis.study import Study
from forcegrasp.identify.fit import Fit, fit_exactly
from forcegrasp.identify.predict import predict


def better_without(name: str, found: Fit, fit: Fit, study: Study) -> Fit | None:
    """A fit without an effect from where one with it has led, if that leaves less than before; None if it does not.

    A model is nested in the one that has an effect besides. Contacts are rough, and where a fit had stopped short, one
    more parameter of any kind may lead on, by however little it is moved itself.

    Args:
      name: of the effect.
      found: the fit with it.
      fit: the one that it was added to.
      study: the measurements.
    """
    problem, start, slopes = problem_without(name, found)
    residual = study.target.residual(predict(study.simulators.exact, [problem.case(start)])[0])
    if np.sum((found.weight * residual) ** 2) + problem.priors.cost(start) > NO_BETTER * fit.cost:
        return None
    return fit_exactly(study.target, problem, study.simulators, start, slopes)
