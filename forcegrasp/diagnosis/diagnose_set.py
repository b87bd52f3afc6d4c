"""Diagnoses a measurement set."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forcegrasp.diagnosis.result import Diagnosis
from forcegrasp.diagnosis.search import diagnose
from forcegrasp.effects import Effect
from forcegrasp.effects.for_gripper import effect_of, effects_of
from forcegrasp.errors import MeasurementError
from forcegrasp.identify import fit_set
from forcegrasp.identify.fit import Simulators
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.progress import Progress
from forcegrasp.measure import MeasurementSet
from forcegrasp.models.model_file import Model
from forcegrasp.physics.gripper import Gripper

#: A diagnosis needs so many grasps: with fewer, nothing can be held out.
LEAST_GRASPS = 6


def diagnose_set(
    loaded: Loaded[MeasurementSet],
    model: Model | None,
    names: list[str],
    seed: int,
    progress: Progress,
) -> tuple[Diagnosis, Simulators]:
    """Which effects are missing.

    Raises:
      MeasurementError: if there are too few grasps to hold any out.
      ConfigError: if an effect is unknown, or can't show on this gripper.
    """
    if loaded.held_out < LEAST_GRASPS:
        raise MeasurementError(
            f"{loaded.measured.path}: {loaded.held_out} grasps are too few for a diagnosis,"
            f" {LEAST_GRASPS} are needed; record more (forcegrasp record shows a plan)"
        )
    if model is None:
        target, simulators, base = fit_set.fit_model(loaded, seed, progress)
    else:
        target, simulators, base = fit_set.apply_model(loaded, model, progress, refit=True)
    chosen = chosen_effects(loaded.gripper, names)
    rng = np.random.default_rng(seed + 1)
    return diagnose(target, base, simulators, chosen, rng, progress), simulators


def chosen_effects(gripper: Gripper, names: Sequence[str]) -> list[type[Effect]]:
    """The effects of these names as a gripper has them, in the order in which they act; without names all.

    Raises:
      ConfigError: if one is unknown, or can't show on this gripper.
    """
    wanted = {effect_of(name, gripper).name for name in names}
    return [effect for name, effect in effects_of(gripper).items() if not names or name in wanted]
