"""Results made up by hand, so that outputs can be held against what was put into them, without any simulation."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.diagnosis.add_effect import Added
from forcegrasp.diagnosis.advice import Advice
from forcegrasp.diagnosis.result import Candidate, Diagnosis, Step
from forcegrasp.diagnosis.signatures import Score
from forcegrasp.effects import get_effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.base_fit import BaseFit
from forcegrasp.identify.comparison import Comparison
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.target import make_target
from forcegrasp.identify.verdict import Verdict
from forcegrasp.measure import MeasuredGrasp, MeasurementSet
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.replay.next_grasp import NextGrasp

#: A name that does harm wherever it is not escaped.
NASTY = "<script>alert(1)</script> $\\frac{1}{0}$ & [red]"
SIGMA = np.array([2.7e-5, 2.7e-5, 0.013, 0.013])


def _grasp(index: int, rng: np.random.Generator) -> MeasuredGrasp:
    """Closes for 1 s, squeezes and holds until 4 s, opens."""
    time = np.arange(150) * 0.04
    command = np.interp(time, [0.4, 1.4, 2.0, 4.0, 5.0], [0.045, 0.02, 0.018, 0.018, 0.045])
    position = np.maximum(command, 0.0195)
    force = 200 * (position - command)
    signals = np.stack([position, position, force, force], axis=1) + SIGMA * rng.standard_normal((150, 4))
    name = NASTY if index == 0 else f"g{index}"
    return MeasuredGrasp(
        name, f"thing {index % 2}", "s", 0.0195, 0.0, None, time, np.repeat(command[:, None], 2, axis=1),
        signals[:, :2], signals[:, 2:], None,
    )  # fmt: skip


def fit_of(problem: Problem, target, residual: np.ndarray) -> Fit:
    """A fit that leaves these residuals ÷ noise."""
    jacobian = np.random.default_rng(1).standard_normal((*residual.shape, len(problem)))
    jacobian[~target.mask] = 0
    predicted = target.signals - residual * target.sigma
    return Fit(problem, problem.start(), predicted, residual, jacobian, 0 * predicted, 0.1, 3, target.weight)


@pytest.fixture(scope="session")
def made_up() -> SimpleNamespace:
    """Eight grasps; the base model misses by 5 σ in the left force during holds, and by 9 σ in grasp g3 of them."""
    rng = np.random.default_rng(0)
    grasps = tuple(_grasp(i, rng) for i in range(8))
    measured = MeasurementSet(
        Path(f"/tmp/{NASTY}"), NASTY, "tiago", NASTY, "none", SIGMA[0], SIGMA[2], grasps, "fingerprint"
    )
    loaded = Loaded(measured, load_gripper("tiago"), [f"odd: {NASTY}"])
    target = make_target(measured, loaded.gripper)
    noise = rng.standard_normal((8, 150, 4))
    # white noise about 0 in every cell, so that a constant can be put on top
    left = noise.copy()
    hold = target.phase == 3
    left[..., 2][hold] += 5.0
    left[3, :, 2][hold[3]] += 4.0
    base = BaseFit(fit_of(Problem(loaded.gripper, grasps), target, left), (2.0, 2.001, 2.3), True)
    names = ("force_bias", "force_drift")
    effects = [get_effect(name) for name in names]
    candidates = []
    for effect, share in zip(effects, (0.0, 0.5), strict=True):
        fit = fit_of(
            Problem(loaded.gripper, grasps, [EffectSetting.typical(effect)]), target, noise + share * (left - noise)
        )
        gains = np.full(8, 100.0 * (1 - share))
        error = float(np.sqrt(np.mean(fit.residual**2)))
        candidates.append(
            Candidate(fit.problem.case(fit.vector).effects[0], fit, 0.002, gains, error, 1 - share, 0.5, np.ones(1))
        )
    poor = [Score(EffectSetting.typical(get_effect(n)), 1.0, np.ones(1)) for n in ("backlash", "force_lag")]
    good = [Score(EffectSetting.typical(effect), 9.0, np.ones(1)) for effect in effects]
    before = float(np.sqrt(np.mean(left**2)))
    folds = tuple(np.array([i, i + 4]) for i in range(4))

    def diagnosis(verdict: str) -> Diagnosis:
        chosen = {"effect": names[:1], "one_of": names}.get(verdict, ())
        step = Step(chosen, tuple(candidates), (*good, *poor), before, 1.0)
        fit = candidates[0].fit if chosen else base.fit
        after = float(np.sqrt(np.mean(fit.residual**2)))
        gate = base if verdict != "not_fitted" else BaseFit(base.fit, (1.0, 2.0, 3.0), False, "the starts differ")
        steps = (step,) if verdict != "not_fitted" else ()
        return Diagnosis(
            Verdict(verdict),
            chosen,
            steps,
            gate,
            fit,
            target,
            folds,
            before,
            after,
            floor=1.02,
            left="" if chosen or verdict == "explained" else "somewhere",
        )

    time, command = grasps[0].time_s, grasps[0].command_m
    predicted = np.stack([target.signals[0], target.signals[0] + 3 * SIGMA])
    next_grasp = NextGrasp(
        grasp="slow ramp", object="thing 0", gripper="tiago", radius_m=0.02, offset_m=0.0, contact=0.02, squeeze=0.003
    )
    advice = Advice(
        next_grasp, (next_grasp,), ("force_bias", "force_drift"), {"slow ramp": 3.0, "long hold": 1.0},
        {"slow ramp": 0.9, "long hold": 0.2}, time, command, predicted,
    )  # fmt: skip
    after_model = model_of(candidates[0].fit, target, loaded, [])
    return SimpleNamespace(
        loaded=loaded,
        target=target,
        comparison=Comparison(target, base.fit.predicted, left, left * 1.1, 1.02),
        base=base,
        model=model_of(base.fit, target, loaded, []),
        diagnosis=diagnosis,
        advice=advice,
        added=Added(target, base.fit, candidates[0].fit, before, 1.0, after_model),
        tried=[get_effect(n) for n in (*names, "backlash", "force_lag", "adhesion")],
    )


def shortened(measured: MeasurementSet, samples: int) -> MeasurementSet:
    """The first samples of each grasp: to simulate less takes less time."""
    names = ("time_s", "command_m", "position_m", "force_n")
    grasps = [dataclasses.replace(g, **{name: getattr(g, name)[:samples] for name in names}) for g in measured.grasps]
    return dataclasses.replace(measured, grasps=tuple(grasps))


def result_of(title: str, answer, sections, data: Loaded, figures: dict | None = None) -> SimpleNamespace:
    """What a report is written from, as results of the verbs have it; its JSON file is ``x.json``."""
    return SimpleNamespace(
        file="x",
        title=title,
        data=data,
        sections=lambda: sections,
        box=lambda out: answer,
        to_dict=lambda: figures or {},
    )
