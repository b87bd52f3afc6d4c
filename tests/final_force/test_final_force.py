"""A table of final forces: what was put in is found, what is not there is not, and nothing is claimed beyond it."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from forcegrasp.effects import catalogue
from forcegrasp.final_force.analysis import TableAnalysis, analyse_table
from forcegrasp.final_force.causes import CAUSES, MENU, causes_of
from forcegrasp.measure.schema import FinalForceTable
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant, write_base
from forcegrasp.reports import final_force as final_force_report
from forcegrasp.reports.html import write_report

GRIPPER = load_gripper("tiago")
DELTA_M = np.arange(1, 11) * 3e-4
#: Lach et al. 2023, "Towards Transferring Tactile-based Continuous Force Control Policies from Simulation to Robot",
#: appendix, figure "Comparison of final forces f(T) of Sponge and Wood for grasps with different Δq_des".
REAL = {
    "sponge": [0.00, 0.10, 0.15, 0.32, 0.37, 0.47, 0.54, 0.60, 0.63, 0.81],
    "wood": [0.00, 0.13, 0.24, 0.36, 0.47, 0.54, 0.62, 0.75, 0.83, 0.94],
}


def table_of(forces: dict[str, np.ndarray], delta_m: np.ndarray = DELTA_M, std: float | None = None) -> FinalForceTable:
    objects = tuple(name for name, force in forces.items() for _ in force)
    delta = np.concatenate([delta_m[: len(force)] for force in forces.values()])
    force = np.concatenate([np.asarray(force, float) for force in forces.values()])
    return FinalForceTable(Path("t"), "t", "tiago", "", "", std, objects, delta, force, "0" * 64)


def analyse(forces: dict[str, np.ndarray], delta_m: np.ndarray = DELTA_M, std: float | None = None) -> TableAnalysis:
    return analyse_table(table_of(forces, delta_m, std), GRIPPER)


def noisy(curves: dict[str, np.ndarray], sigma: float, seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {name: curve + sigma * rng.standard_normal(len(curve)) for name, curve in curves.items()}


def dead_zone(slope: float, onset_m: float) -> np.ndarray:
    return slope * np.maximum(DELTA_M - onset_m, 0)


# --- the real table --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def real() -> TableAnalysis:
    return analyse({name: np.array(force) for name, force in REAL.items()})


def test_base_law_of_the_real_table(real):
    for name, kappa, error in (("sponge", 0.554, 0.045), ("wood", 0.433, 0.037)):
        fit = real.base.fits[name]
        assert real.kappa(name) == pytest.approx(kappa, abs=5e-4)
        assert np.sqrt(np.mean(fit.residual**2)) == pytest.approx(error, abs=6e-4)


def test_dead_zone_of_the_real_table(real):
    assert real.verdict == "one_of"
    assert real.found == ("dead_zone",)
    for name, onset_mm, slope, error in (("sponge", 0.24, 283, 0.032), ("wood", 0.21, 339, 0.018)):
        fit = real.best.fits[name]
        assert 1e3 * fit.values[1] == pytest.approx(onset_mm, abs=5e-3)
        assert fit.slope == pytest.approx(slope, abs=0.5)
        assert np.sqrt(np.mean(fit.residual**2)) == pytest.approx(error, abs=6e-4)
        (low, high), (first, last) = real.intervals[name]["dead_zone"]
        assert low < slope < high
        assert 0 < first < 1e-3 * onset_mm < last < 6e-4


def test_the_real_table_names_a_set_and_a_grasp(real):
    look_alikes = {"backlash", "force_deadzone", "command_deadband", "adhesion", "coulomb_friction", "stiction"}
    assert look_alikes | {"encoder_bias"} <= set(real.effects)
    assert not {"command_delay", "force_lag", "object_friction", "viscoelastic_contact"} & set(real.effects)
    assert final_force_report.diagnosis_json(real)["next_grasp"]["grasp"] in MENU
    assert real.slopes_differ_p < 0.01
    assert real.slope_ratio[0] == pytest.approx(339 / 283, abs=0.01)
    assert abs(real.shared["travel"] - real.shared["force"]) < 1e-3  # a gap or a threshold: these rows can't tell
    assert any("sponge 0.554, wood 0.433" in line for line in final_force_report.lines(real))


# --- the truth is recovered ------------------------------------------------------------------------------------------


def test_straight_lines_are_explained():
    found = analyse(noisy({"a": 300 * DELTA_M, "b": 150 * DELTA_M}, 0.01, 0), std=0.01)
    assert (found.verdict, found.effects, found.found) == ("explained", (), ())
    low, high = found.intervals["a"]["base"][0]
    assert low < 300 < high
    assert high - low < 30
    assert found.force_scale("b")[0] == pytest.approx(1.5, abs=0.1)
    assert final_force_report.diagnosis_json(found)["next_grasp"] is None


def test_dead_zone_is_recovered():
    found = analyse(noisy({"a": dead_zone(300, 3e-4), "b": dead_zone(200, 3e-4)}, 0.01, 1))
    assert (found.verdict, found.found[0]) == ("one_of", "dead_zone")
    for name, slope in (("a", 300), ("b", 200)):
        (low, high), (first, last) = found.intervals[name]["dead_zone"]
        assert low < slope < high
        assert first < 3e-4 < last
    sizes = {entry["effect"]: entry["parameters"] for entry in final_force_report.diagnosis_json(found)["ranking"]}
    assert sizes["backlash"]["gap_m"] == pytest.approx(6e-4, abs=1.5e-4)
    assert sizes["coulomb_friction"]["force_n"] == pytest.approx(0.03, abs=0.008)


def test_threshold_force_is_told_from_travel_where_slopes_differ():
    force = {"a": dead_zone(100, 9e-4), "b": dead_zone(450, 2e-4)}  # 0.09 N both
    shared = analyse(noisy(force, 0.005, 2)).shared
    assert shared["force"] < 0.5 * shared["travel"]


def test_plateau_is_recovered():
    found = analyse(noisy({"a": np.minimum(300 * DELTA_M, 0.5), "b": np.minimum(250 * DELTA_M, 0.5)}, 0.01, 3))
    assert (found.verdict, found.found[0]) == ("one_of", "plateau")
    assert set(found.effects) == {"force_limit", "force_saturation"}
    assert found.best.fits["a"].values[1] == pytest.approx(0.5 / 300, rel=0.05)


def test_gate_names_the_thresholds():
    force = {"a": np.where(DELTA_M > 8e-4, 300 * DELTA_M, 0), "b": np.where(DELTA_M > 8e-4, 200 * DELTA_M, 0)}
    found = analyse(noisy(force, 0.005, 4))
    assert found.found[0] == "gate"
    assert {"command_deadband", "force_deadzone"} <= set(found.effects)
    assert set(CAUSES["gate"]) == {"command_deadband", "position_deadband", "force_deadzone"}


def test_positive_offset_names_biases():
    found = analyse(noisy({"a": 0.1 + 300 * DELTA_M, "b": 0.1 + 200 * DELTA_M}, 0.01, 5))
    assert found.found[0] == "bias"
    assert set(found.effects) == {"force_bias", "force_drift", "encoder_bias"}


def test_a_bent_curve_is_unknown():
    force = {name: top * (DELTA_M / DELTA_M[-1]) ** 2 for name, top in (("a", 0.9), ("b", 0.6))}
    found = analyse(noisy(force, 0.01, 6))
    assert (found.verdict, found.effects) == ("unknown", ())
    assert final_force_report.diagnosis_json(found)["where"]["signal"] == "final_force"


def test_scatter_beyond_the_given_noise_is_unknown():
    found = analyse(noisy({"a": 300 * DELTA_M, "b": 200 * DELTA_M}, 0.05, 7), std=0.01)
    assert found.verdict == "unknown"
    assert "times the noise" in found.reason


def test_different_slopes_are_told_apart():
    assert analyse(noisy({"a": 300 * DELTA_M, "b": 250 * DELTA_M}, 0.01, 8)).slopes_differ_p < 0.01
    assert analyse(noisy({"a": 300 * DELTA_M, "b": 300 * DELTA_M}, 0.01, 12)).slopes_differ_p > 0.05


def test_one_object_has_nothing_to_compare_slopes_with():
    found = analyse(noisy({"a": dead_zone(300, 4e-4)}, 0.005, 9))
    assert found.verdict == "one_of"
    assert found.slope_ratio is None
    assert found.shared == {}


def test_repeated_squeezes_give_the_noise():
    delta = np.tile(DELTA_M, 3)
    found = analyse(noisy({"a": 300 * delta}, 0.02, 13), delta)
    assert found.verdict == "explained"
    assert found.noise_from == "from 20 repeated squeezes"
    assert found.noise_n == pytest.approx(0.02, rel=0.4)


def test_a_table_without_noise_is_exact():
    assert analyse({"a": 300 * DELTA_M}).verdict == "explained"
    exact = analyse({"a": dead_zone(300, 4e-4)})
    assert exact.found == ("dead_zone",)
    assert exact.best.fits["a"].values == pytest.approx([300, 4e-4], rel=1e-3)


# --- nothing is claimed from nonsense --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("force", "why"),
    [
        (np.array([0.1, 0.2, 0.3]), "3 rows"),
        (np.zeros(10), "does not grow"),
        (0.03 * np.random.default_rng(0).standard_normal(10), "does not grow"),
        (0.9 - 300 * DELTA_M, "does not grow"),
    ],
)
def test_too_little_is_not_fitted(force, why):
    found = analyse({"a": force})
    assert found.verdict == "not_fitted"
    assert why in found.reason
    assert why in "\n".join(final_force_report.lines(found))
    assert json.loads(json.dumps(final_force_report.diagnosis_json(found), allow_nan=False))["error_before"] is None
    assert final_force_report.compare_json(found)["floor_ratio"] is None
    assert final_force_report.sections(found)


def test_one_delta_again_and_again_is_not_fitted():
    found = analyse({"a": np.array([0.3, 0.31, 0.29, 0.3, 0.32])}, np.full(5, 1e-3))
    assert "1 different deltas" in found.reason


def test_a_short_object_is_left_out_and_named():
    found = analyse(noisy({"a": 300 * DELTA_M, "b": 300 * DELTA_M[:3]}, 0.01, 11))
    assert found.verdict == "explained"
    assert list(found.rows) == ["a"]
    assert any(line.startswith("b: left out, 3 rows") for line in final_force_report.lines(found))


def test_four_rows_are_fitted_and_prove_nothing():
    found = analyse({"a": np.array([0.0, 0.0, 0.3, 0.6])}, np.array([0.0, 1e-3, 2e-3, 3e-3]))
    assert found.verdict == "explained"


# --- error rates -----------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize(("std", "tables"), [(None, 200), (0.03, 100)])
def test_false_alarms_are_rare(std, tables):
    curves = {"sponge": 283 * DELTA_M, "wood": 339 * DELTA_M}
    alarms = sum(analyse(noisy(curves, 0.03, seed), std=std).verdict != "explained" for seed in range(tables))
    assert alarms <= 0.05 * tables


@pytest.mark.parametrize(("std", "least"), [(None, 24), (0.03, 32)])
def test_a_dead_zone_of_the_robots_size_is_usually_seen(std, least):
    curves = {"sponge": dead_zone(283, 2e-4), "wood": dead_zone(339, 2e-4)}
    found = [analyse(noisy(curves, 0.03, seed), std=std) for seed in range(40)]
    assert sum("dead_zone" in f.found for f in found) >= least
    assert all("backlash" in f.effects for f in found if "dead_zone" in f.found)


# --- what is handed on -----------------------------------------------------------------------------------------------


def test_json_has_the_fixed_keys_and_plain_numbers(real):
    compare, diagnosis = final_force_report.compare_json(real), final_force_report.diagnosis_json(real)
    assert set(compare) == {"set", "model", "signals", "phases", "floor_ratio", "heldout"}
    assert set(diagnosis) == {
        "verdict", "effects", "steps", "ranking", "error_before", "error_after", "floor_ratio", "next_grasp", "where",
    }  # fmt: skip
    for entry in diagnosis["ranking"]:
        assert set(entry) == {"effect", "p_family", "heldout_gain", "floor_ratio_after", "parameters"}
        assert entry["effect"] in catalogue()
    assert set(compare["signals"]["final_force"]["objects"]) == {"sponge", "wood"}
    assert "hold" in compare["phases"]
    for document in (compare, diagnosis):
        assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert diagnosis["error_after"] < diagnosis["error_before"]


def test_analysis_is_the_same_every_time(real):
    again = analyse({name: np.array(force) for name, force in REAL.items()})
    assert final_force_report.diagnosis_json(again) == final_force_report.diagnosis_json(real)
    assert final_force_report.lines(again) == final_force_report.lines(real)


def test_a_dollar_in_a_name_is_no_mathematics():
    final_force_report.draw(analyse({"a$b_{$c": 200 * DELTA_M, "d": 300 * DELTA_M})).savefig(picture := io.BytesIO())
    assert picture.getvalue()


def test_sections_make_a_report(real, tmp_path):
    html = write_report(tmp_path / "r.html", "t", "lead", final_force_report.sections(real), {}).read_text(
        encoding="utf-8"
    )
    assert "dead zone" in html
    assert "can&#39;t tell" in html or "can't tell" in html
    assert html.count("<svg") == 1


# --- the list of causes is what simulation shows ---------------------------------------------------------------------

_SIZES: dict[str, list[tuple[str, tuple[float, ...]]]] = {
    "command_deadband": [("position", (3e-4,)), ("held", (3e-4,))],
    "force_bias": [("", (-0.05, -0.05))],
    "force_drift": [("", (-0.02, -0.02))],
    "encoder_bias": [("", (2e-4, 2e-4))],
    "force_hysteresis": [("", (0.1, 0.0))],
    "backlash": [("play", (1e-3,)), ("loose", (1e-3,)), ("command", (6e-4,))],
    "force_deadzone": [("subtract", (0.08,)), ("gate", (0.08,))],
    "quantisation": [("", (0.0, 0.01))],
}


def simulated_onsets(again_and_again: bool, names: Iterable[str] = catalogue()) -> dict[str, float]:
    """By how much each effect moves the delta at which forces reach 25 mN, metres; of its variants the most."""
    delta = np.r_[np.arange(1, 9) * 1e-4, 1.1e-3, 1.6e-3]
    cases = [("none", "", ())]
    for name in names:
        effect = catalogue()[name]
        typical = [(variant, tuple(effect.typical_values())) for variant in effect.variants]
        cases += [(name, variant, values) for variant, values in _SIZES.get(name, typical)]
    m, n = len(delta), len(delta) * len(cases)
    plant = Plant(GRIPPER, n, "fast", 2)
    plant.attach(
        [
            (catalogue()[name](np.tile(values, (m, 1)), plant.dt, variant), np.arange(k * m, (k + 1) * m))
            for k, (name, variant, values) in enumerate(cases)
            if name != "none"
        ]
    )
    ids, all_deltas = np.arange(n), np.tile(delta, len(cases))[:, None]
    offset = write_base(plant, ids, {"force_scale": np.full(n, 2.5), "radius_m": np.full(n, 0.025)})
    plant.reset(ids, offset, np.full((n, 2), 0.0255))
    for _ in range(50):
        target = plant.measured_position if again_and_again else np.full((n, 2), 0.0247)  # where the pads meet it
        plant.advance(target - all_deltas, 10)
    force = plant.measured_force.mean(axis=1).reshape(len(cases), m)
    onsets = np.array([np.interp(0.025, np.maximum.accumulate(row), delta) for row in force])
    moved: dict[str, float] = {}
    for (name, _, _), onset in zip(cases[1:], onsets[1:], strict=True):
        moved[name] = max(moved.get(name, 0.0), onset - onsets[0])
    return moved


@pytest.mark.long
def test_causes_of_a_dead_zone_are_those_that_simulation_shows():
    again, once = simulated_onsets(True), simulated_onsets(False, ["adhesion", "backlash"])
    late = {name for name, moved in again.items() if moved > 5e-5}
    assert late == (set(CAUSES["dead_zone"]) | set(CAUSES["gate"])) - {"adhesion"}
    assert once["adhesion"] > 5e-5
    assert once["backlash"] > 5e-5


def test_every_cause_is_an_effect_of_the_catalogue():
    assert set(causes_of(CAUSES)) == {name for of in CAUSES.values() for name in of}
