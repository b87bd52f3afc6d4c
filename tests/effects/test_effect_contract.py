"""What every effect of the catalogue owes, in each of its variants: a new one is covered by being registered."""

from __future__ import annotations

import functools
import re
import subprocess
import sys
from collections.abc import Sequence

import numpy as np
import pytest

from forcegrasp.effects import STAGES, Effect, catalogue, get_effect

from .rollouts import OFFSETS_M, RICH, Trace, Use, make_plant, play, rollout, start

#: All but those that need another mechanism than TIAGo: see test_elastic_joint.py.
OWING = [e for e in catalogue().values() if not e.needs_load_behind_rotor]
KINDS = [(e, v) for e in OWING for v in e.variants]
CASES = [pytest.param(e, v, id=f"{e.name}-{v}".rstrip("-")) for e, v in KINDS]
SIZES = [
    pytest.param(e, v, p, id="-".join(filter(None, (e.name, v, p.name))))
    for e in OWING
    for v in e.variants
    for p in e.parameters
]
NESTED = [(e, nested) for e in catalogue().values() for nested in e.contains]
EFFECTS = [pytest.param(e, id=e.name) for e in catalogue().values()]
TIERS = ("fast", "reference")


@functools.cache
def bare(tier: str) -> Trace:
    return rollout(3, tier=tier)


def everything(rows: Sequence[int] = (0, 1)) -> list[Use]:
    """All effects at typical sizes."""
    return [(e, e.typical_values(), "", rows) for e in OWING]


@functools.cache
def full() -> Trace:
    return rollout(2, everything())


@functools.cache
def null_among_others() -> Trace:
    """All effects on all rows, and each kind once more at its null value, on two rows of its own."""
    n = 2 * len(KINDS)
    nulls = [(effect, effect.null_values(), variant, (2 * i, 2 * i + 1)) for i, (effect, variant) in enumerate(KINDS)]
    return rollout(n, [*everything(range(n)), *nulls], offset_m=np.tile(OFFSETS_M[:2], len(KINDS)))


@functools.cache
def typical(effect: type[Effect], variant: str) -> Trace:
    """One effect at its typical size, on three rows."""
    return rollout(3, [(effect, effect.typical_values(), variant, range(3))])


def grown(effect: type[Effect], name: str, factor: float) -> np.ndarray:
    """Typical values, one so many times as far from its null value, within bounds; an infinite one is divided."""
    values = effect.typical_values()
    index = [p.name for p in effect.parameters].index(name)
    p = effect.parameters[index]
    values[index] = p.typical / factor if np.isinf(p.null) else p.null + factor * (p.typical - p.null)
    values[index] = np.clip(values[index], p.low, p.high)
    return values


# --- identity ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tier", TIERS)
@pytest.mark.parametrize(("effect", "variant"), CASES)
def test_null_values_and_other_rows_change_no_bit(effect, variant, tier):
    values = [effect.null_values(), effect.typical_values()]
    trace = rollout(3, [(effect, values, variant, [0, 2])], tier)
    assert trace.row(0) == bare(tier).row(0)
    assert trace.row(1) == bare(tier).row(1)
    assert trace.row(2) != bare(tier).row(2)


@pytest.mark.parametrize(("effect", "variant"), CASES)
def test_null_values_change_no_bit_among_other_effects(effect, variant):
    first = 2 * KINDS.index((effect, variant))
    assert all(null_among_others().row(first + row) == full().row(row) for row in (0, 1))


@pytest.mark.parametrize("tier", TIERS)
def test_all_null_values_at_once_change_no_bit(tier):
    trace = rollout(3, [(e, e.null_values(), "", range(3)) for e in OWING], tier)
    for row in range(3):
        assert trace.row(row) == bare(tier).row(row)


def test_none_changes_no_bit():
    trace = rollout(3, [(get_effect("none"), np.empty((3, 0)), "", range(3))])
    assert all(trace.row(row) == bare("fast").row(row) for row in range(3))


# --- sensitivity ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("effect", "variant", "parameter"), SIZES)
def test_every_parameter_counts(effect, variant, parameter):
    """A size that is put back to its null value, or a shape that is doubled, is seen."""
    index = effect.parameters.index(parameter)
    changed = effect.typical_values()
    changed[index] = parameter.null if parameter.typical != parameter.null else 2 * parameter.typical
    trace = rollout(2, [(effect, [effect.typical_values(), changed], variant, [0, 1])], offset_m=np.full(2, 0.001))
    assert trace.row(0) != trace.row(1)


@pytest.mark.parametrize(("effect", "variant", "parameter"), SIZES)
def test_more_of_it_changes_more(effect, variant, parameter):
    if parameter.typical == parameter.null:
        return  # a shape, not a size
    others = np.array([p.null if p != parameter and p.typical != p.null else p.typical for p in effect.parameters])
    index = effect.parameters.index(parameter)
    sizes = list(dict.fromkeys(grown(effect, parameter.name, factor)[index] for factor in (1, 2, 4)))  # within bounds
    values = np.repeat([others] * len(sizes), 3, axis=0)
    values[:, index] = np.repeat(sizes, 3)
    trace = rollout(len(values), [(effect, values, variant, range(len(values)))])
    distances = [trace.rows(3 * i, 3 * i + 3).distance(bare("fast")) for i in range(len(sizes))]
    assert distances[0] > 0
    assert np.all(np.diff(distances) > 0), distances


@pytest.mark.parametrize(("effect", "variant"), CASES)
def test_extremes_are_simulated_without_a_warning(effect, variant):
    bounds = [[p.low for p in effect.parameters], [p.high for p in effect.parameters]]
    trace = rollout(4, [(effect, np.repeat(bounds, 2, axis=0), variant, range(4))])
    assert all(np.isfinite(values).all() for values in vars(trace).values())
    assert np.abs(trace.true_position).max() < 0.06


def test_variants_differ():
    for effect in catalogue().values():
        # objects of this gripper have no stiffness of their own
        variants = [v for v in effect.variants if effect.variant_needs.get(v) != "stiffness of objects"]
        if len(variants) == 1:
            continue
        traces = [rollout(1, [(effect, effect.typical_values(), v, [0])]) for v in variants]
        rows = [trace.row(0) for trace in traces]
        assert all(rows[i] != rows[j] for i in range(len(rows)) for j in range(i)), effect.name


# --- simpler effects inside ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("effect", "nested"), [pytest.param(e, n, id=f"{e.name}-{n.effect}") for e, n in NESTED])
def test_an_effect_is_the_simpler_one_that_it_contains(effect, nested):
    """To the last bit, in both tiers; and it is not where a parameter has another value."""
    simpler = get_effect(nested.effect)
    assert {p.name for p in simpler.parameters} == set(nested.same.values())
    assert {p.name for p in effect.parameters} >= set(nested.at) | set(nested.same)
    assert not set(nested.at) & set(nested.same)
    richer = {p.name: p.typical for p in effect.parameters}
    values = np.array([richer[next(r for r, s in nested.same.items() if s == p.name)] for p in simpler.parameters])
    inside = np.array([(richer | dict(nested.at))[p.name] for p in effect.parameters])
    uses = [(simpler, values, "", [0]), (effect, [inside, effect.typical_values()], "", [1, 2])]
    for tier in TIERS:
        trace = rollout(3, uses, tier, offset_m=np.full(3, OFFSETS_M[0]))
        assert trace.row(1) == trace.row(0)
        assert trace.row(2) != trace.row(0)


@pytest.mark.parametrize(("effect", "nested"), [pytest.param(e, n, id=f"{e.name}-{n.effect}") for e, n in NESTED])
def test_where_an_effect_is_a_simpler_one_is_alike_for_all_grippers(effect, nested):
    """Values of parameters that are scaled from gripper to gripper would not be."""
    follows = {p.name: p.follows for p in effect.parameters}
    assert all(value in (0, np.inf) or not follows[name] for name, value in nested.at.items())


# --- rows and resets -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("effect", "variant"), CASES)
def test_rows_of_a_batch_are_as_if_alone(effect, variant):
    values, offsets = np.array([effect.typical_values()] * 2), np.array([0.001, -0.0005])
    for i, p in enumerate(effect.parameters):
        values[1, i] = grown(effect, p.name, 2)[i] if p.typical != p.null else 2 * p.typical
    together = rollout(2, [(effect, values, variant, [0, 1])], offset_m=offsets)
    for row in (0, 1):
        alone = rollout(1, [(effect, values[row], variant, [0])], offset_m=offsets[[row]])
        assert alone.row(0) == together.row(row)


@pytest.mark.parametrize(("effect", "variant"), CASES)
def test_a_reset_forgets_its_rows_and_no_others(effect, variant):
    """Rows that are reset in the middle of a grasp start as on a fresh plant; the others go on as if nothing were."""
    uses = [(effect, effect.typical_values(), variant, [0, 1, 2])]
    fresh, when = typical(effect, variant), 18  # in the partial release
    plant = make_plant(3, uses)
    start(plant, range(3))
    play(plant, RICH[:when])
    kept = plant.measured_force[0].copy(), plant.measured_position[0].copy()
    start(plant, [1, 2])
    assert np.array_equal(kept, (plant.measured_force[0], plant.measured_position[0]))
    commands = np.stack([np.roll(RICH, -when, axis=0), RICH, RICH], axis=1)
    after = play(plant, commands)
    left = len(RICH) - when
    assert after.row(1) == fresh.row(1)
    assert after.row(2) == fresh.row(2)
    for name, values in vars(after).items():
        assert values[:left, 0].tobytes() == getattr(fresh, name)[when:, 0].tobytes(), name


@pytest.mark.parametrize(("effect", "variant"), CASES)
def test_a_plant_whose_effects_are_taken_away_is_a_bare_one(effect, variant):
    plant = make_plant(3, [(effect, effect.typical_values(), variant, range(3))])
    start(plant, range(3))
    play(plant, RICH[:20])
    plant.attach([])
    start(plant, range(3))
    trace = play(plant)
    assert all(trace.row(row) == bare("fast").row(row) for row in range(3))


def test_the_order_of_attaching_does_not_matter():
    assert full().row(0) == rollout(2, everything()[::-1]).row(0)


# --- what it says about itself -------------------------------------------------------------------------------------


@pytest.mark.parametrize("effect", EFFECTS)
def test_metadata(effect):
    for text in (effect.symptom, effect.formula, effect.source, effect.separates, *(p.doc for p in effect.parameters)):
        assert text.strip() == text
        assert text
    assert re.fullmatch(r"[a-z]+(_[a-z]+)*", effect.name)
    assert effect.stage in STAGES
    assert effect.family not in ("", "other")
    assert effect.parameters
    assert effect.hooks()
    assert effect.name not in effect.look_alikes
    assert set(effect.look_alikes) <= set(catalogue())
    first = (effect.__doc__ or "").splitlines()[0]
    assert first.endswith(".")
    for variant in filter(None, effect.variants):
        assert f"``{variant}``" in effect.__doc__


@pytest.mark.parametrize(("effect", "variant", "parameter"), SIZES)
def test_parameters(effect, variant, parameter):
    p = parameter
    assert p.unit
    ending = p.unit.lower().replace("·", "").replace("1/", "per/").replace("/", "_")
    assert p.unit == "1" or p.name.endswith(f"_{ending}"), f"a name ends with its unit: …_{ending}"
    assert p.low < p.typical < p.high
    assert all(p.low <= size <= p.high for size in p.trials)
    assert np.isinf(p.null) or p.low <= p.null <= p.high
    if p.logarithmic:
        assert p.low > 0


@pytest.mark.parametrize("effect", EFFECTS)
def test_trials_lie_within_the_bounds(effect):
    trials, low, high = effect.trials(), *np.array([(p.low, p.high) for p in effect.parameters]).T
    assert trials.ndim == 2
    assert trials.shape[1] == len(effect.parameters)
    assert np.all((trials >= low) & (trials <= high))
    assert not (trials == effect.null_values()).all(axis=1).any()


@pytest.mark.parametrize("effect", EFFECTS)
def test_look_alikes_are_mutual_or_explained(effect):
    assert effect.separates or not effect.look_alikes


@pytest.mark.parametrize("effect", EFFECTS)
def test_wrong_use_is_refused(effect):
    with pytest.raises(ValueError, match=effect.name):
        effect(np.zeros((2, len(effect.parameters) + 1)), 0.002)
    with pytest.raises(ValueError, match="no variant 'nonsense'"):
        effect(effect.typical_values()[None], 0.002, "nonsense")


@pytest.mark.parametrize(("effect", "variant"), CASES)
def test_what_a_class_says_of_its_variants_is_true(effect, variant):
    """`reads_only`: nothing that happens changes. `reads`: what is read differs from what happens."""
    trace = typical(effect, variant)
    moved = trace.true_position.tobytes() != bare("fast").true_position.tobytes()
    assert moved != effect.reads_only(variant)
    read = not all(map(np.array_equal, (trace.position, trace.force), (trace.true_position, trace.true_force)))
    assert read == effect.reads()


def test_longest_is_the_largest_that_will_be():
    delay = get_effect("command_delay")
    values = np.array([[0.01], [0.04]])
    assert delay(values, 0.002).longest("delay_s") == 0.04
    assert delay(values, 0.002, "", np.array([0.02])).longest("delay_s") == 0.04
    assert delay(values, 0.002, "", np.array([0.2])).longest("delay_s") == 0.2


@pytest.mark.parametrize("name", ["command_delay", "force_delay"])
def test_delays_that_are_drawn_anew_act(name):
    """Values written before a reset are those of the new grasps; rows that are not reset keep theirs."""
    kind, n = get_effect(name), 3
    plant = make_plant(n)
    effect = kind(np.full((n, 1), 0.02), plant.dt, "", np.array([0.1]))
    plant.attach([(effect, np.arange(n))])
    start(plant, range(n))
    play(plant, RICH[:18])
    effect.values[1:] = [[0.1], [0.0]]
    start(plant, [1, 2])
    commands = np.stack([np.roll(RICH, -18, axis=0), RICH, RICH], axis=1)
    after = play(plant, commands)
    fresh = rollout(n, [(kind, [[0.02], [0.1], [0.0]], "", range(n))])
    assert after.row(1) == fresh.row(1)
    assert after.row(2) == fresh.row(2) == bare("fast").row(2)
    assert after.position[: len(RICH) - 18, 0].tobytes() == fresh.position[18:, 0].tobytes()


def test_no_torch():
    program = """
import sys
for name in ("torch", "torchrl", "tensordict"):
    sys.modules[name] = None  # importing it raises
import forcegrasp.effects
assert len(forcegrasp.effects.catalogue()) > 20
"""
    subprocess.run([sys.executable, "-c", program], check=True)
