"""Verbs that begin with the same fit of the same set share it, where what follows is tested."""

from __future__ import annotations

import pytest

from forcegrasp.identify import fit_set
from forcegrasp.identify.loading import Loaded


def fit_each_set_once(patch: pytest.MonkeyPatch) -> None:
    """Keeps base fits by all that they depend on, what was measured and the seed, each brought to its end."""
    fit_model, known = fit_set.fit_model, {}

    def fit_once(loaded: Loaded, seed: int, progress, hasty: bool = False):
        key = (loaded.measured.fingerprint, loaded.gripper.name, seed)
        if key not in known:
            known[key] = fit_model(loaded, seed, progress)
        return known[key]

    patch.setattr(fit_set, "fit_model", fit_once)
