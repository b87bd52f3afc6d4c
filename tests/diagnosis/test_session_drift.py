"""What changes in the course of a session is told from what is off in all of it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis.faults.session_drift import session_drift
from forcegrasp.identify.fit_set import apply_model
from tests.diagnosis.test_faults_of_the_set import changed, silent, with_model
from tests.light_set import light_set


@pytest.mark.parametrize(
    ("share", "found"),
    [
        (lambda i: 0.15 + 0.0 * i, None),  # one sensor reads more, always: no drift, though one would explain much
        (lambda i: 0.03 * i, "gain"),
    ],
)
def test_a_gain_that_is_off_in_all_grasps_does_not_drift(share, found):
    loaded, model = with_model(light_set(seed=15))
    places = {g.name: i for i, g in enumerate(loaded.measured.grasps)}

    def with_gain(g):
        force = g.force_n * np.array([1.0, 1 - share(places[g.name])])
        return dataclasses.replace(g, force_n=force, session="1")

    target, _, base = apply_model(changed(loaded, with_gain), model, silent, refit=True)
    drift = session_drift(target, base.fit)
    assert (drift and drift.of) == found
