"""The rig does what its effects say; the same MuJoCo scene as the authors', independently written."""

from __future__ import annotations

import csv
import dataclasses
import json
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml

from .catalogue import CATALOGUE, CLASSES, OTHERWISE, OUTSIDE, VARIANT_OF, VARIANTS, build_effects
from .noises import NOISES
from .plan import Setup, Thing, draw_setup
from .rig import FORCE_STD_N, PLANTS, POSITION_STD_M, record, record_one_more, simulate
from .scene import Servo, compile_model
from .spoiled import SPOILED

GAIN, F_ALPHA, OFFSET = 100.0, 2.0, 0.003
# When the commands of the little grasp below are sent, and where they have settled.
NEAR, NUDGE, SQUEEZE, EASE, RELEASE, END = 2, 17, 26, 46, 56, 68


@cache
def little_setup(pace: int = 1) -> Setup:
    """A centred and an off-centre object: approach, nudge, squeeze, ease, release, all in steps.

    With a ``pace`` of 2 steps follow one another twice as fast, before all has settled.
    """
    path = np.empty(END // pace)
    levels = {0: 0.045, NEAR: 0.03, NUDGE: 0.0298, SQUEEZE: 0.0232, EASE: 0.0234, RELEASE: 0.03}
    for start, level in levels.items():
        path[start // pace :] = level
    commands = np.broadcast_to(path[None, :, None], (2, len(path), 2)).copy()
    things = [Thing("thing", 0.025, 0.005, F_ALPHA)]
    return Setup(Servo(GAIN, -9.0), things, np.array([0, 0]), np.array([0.0, OFFSET]), np.array([1, 1]), commands)


@cache
def rig(name: str = "", size: str = "medium", pace: int = 1, **parameters: float):
    """The little grasp, without noise, with one effect."""
    chosen = {name: parameters or size} if name else {}
    return simulate(little_setup(pace), build_effects(chosen), contact="penalty", noise="none")


@pytest.mark.parametrize("contact", ["mujoco", "penalty"])
def test_pads_press_as_soon_as_they_are_inside_the_outline(contact: str) -> None:
    """What effects in the contact call the depth, too."""
    path = np.linspace(0.0256, 0.0236, 100)  # slowly
    commands = np.repeat(path[None, :, None], 2, axis=2)
    one = {"thing": np.zeros(1, int), "offset": np.zeros(1), "session": np.ones(1, int)}
    setup = dataclasses.replace(little_setup(), **one, commands=commands)
    run = simulate(setup, {}, contact=contact, noise="none")
    inside = 0.025 - run.q[0]
    assert np.all(run.f[0][inside < -1e-5] == 0)
    assert np.all(run.f[0][inside > 1e-4] > 0)


def test_null_effects_change_no_bit() -> None:
    everything = {name: kind() for name, kind in CLASSES.items()}
    setup = draw_setup(3, 3, "rich", 40)
    for contact in ("mujoco", "penalty"):
        plain, null = (simulate(setup, effects, 3, contact) for effects in ({}, everything))
        np.testing.assert_array_equal(plain.q, null.q)
        np.testing.assert_array_equal(plain.f, null.f)


@pytest.mark.parametrize("name", sorted(CATALOGUE | VARIANTS | OTHERWISE | OUTSIDE))
def test_every_effect_shows(name: str) -> None:
    plain, hidden = rig(pace=2), rig(name, "large", pace=2)
    assert np.isfinite([hidden.q, hidden.f]).all()
    largest = max(np.max(abs(hidden.q - plain.q)) / POSITION_STD_M, np.max(abs(hidden.f - plain.f)) / FORCE_STD_N)
    assert largest > 3


def test_names() -> None:
    assert set(CATALOGUE) | set(VARIANTS) | set(OTHERWISE) | set(OUTSIDE) == set(CLASSES)
    assert set(VARIANT_OF) == set(VARIANTS)
    answers = set(VARIANT_OF.values()) | {name for name, _ in OTHERWISE.values()}
    assert answers <= set(CATALOGUE) | {"two_mass_backlash"}


def test_symptoms_of_the_command() -> None:
    plain = rig()
    late = rig("command_delay", latency=0.08)
    np.testing.assert_allclose(late.q[:, 2:], plain.q[:, :-2], atol=1e-12)
    np.testing.assert_allclose(late.f[:1, 2:], plain.f[:1, :-2], atol=1e-9)
    assert np.all(plain.q[:, NUDGE] - plain.q[:, SQUEEZE] > 1.5e-4)
    band = rig("command_deadband", band=3e-4)
    assert np.all(abs(band.q[:, NUDGE] - band.q[:, SQUEEZE]) < 3e-5)
    slow = rig("rate_limit", speed=0.02)
    assert np.max(abs(np.diff(slow.q[0], axis=0))) < 0.02 * 0.04 * 1.1


@pytest.mark.long
def test_symptoms_of_the_drive() -> None:
    plain, settled = rig(), [NUDGE, SQUEEZE, EASE, RELEASE]
    friction = rig("coulomb_friction", level=0.03)
    np.testing.assert_allclose(friction.q[:, NUDGE] - 0.03, 0.03 / GAIN, rtol=0.2)  # short of a closing command
    assert np.all(friction.q[:, END - 1] < 0.03 - 1e-4)  # and of an opening one
    stiction = rig("stiction", breakaway=0.05, sliding=0.01)
    assert np.all(abs(stiction.q[:, NUDGE] - stiction.q[:, SQUEEZE]) < 3e-5)  # 0.2 mm · 100 N/m: it sticks
    loaded = rig("load_friction", coefficient=0.2)
    np.testing.assert_allclose(loaded.q[0, SQUEEZE] - plain.q[0, SQUEEZE], 0, atol=5e-5)  # nothing is carried there
    assert np.all(plain.f[0, EASE] - plain.f[0, RELEASE] > 0.02)
    np.testing.assert_allclose(loaded.f[0, EASE], loaded.f[0, RELEASE], atol=0.004)  # the load holds the gears
    offset = rig("motor_offset", left=0.03, right=-0.02)
    for rests in (NUDGE, END - 1):  # from above, and from below
        np.testing.assert_allclose(offset.q[:, rests] - plain.q[:, rests], [[3e-4, -2e-4]] * 2, rtol=0.1)
    bristles = rig("presliding", level=0.03, slip=1e-4)
    np.testing.assert_allclose(bristles.q[:, NUDGE] - 0.03, 0.03 / GAIN, rtol=0.2)  # a long way: as dry friction
    eased = [run.q[0, RELEASE] - run.q[0, EASE] for run in (friction, bristles, plain)]
    assert np.all((eased[0] + 1e-5 < eased[1]) & (eased[1] < eased[2] - 1e-5))  # it gives way to a part
    slower = rig("direction_friction", excess=10.0)
    np.testing.assert_allclose(slower.q[:, NUDGE], plain.q[:, NUDGE], atol=1e-6)
    assert np.all(slower.q[:, RELEASE + 3] < plain.q[:, RELEASE + 3] - 1e-4)
    idle = rig("position_deadband", band=1e-3)
    assert np.all(abs(idle.q[:, NUDGE] - idle.q[:, SQUEEZE]) < 3e-5)
    assert np.all((idle.q[:, NUDGE] - 0.03 > 2e-4) & (idle.q[:, NUDGE] - 0.03 < 1e-3))
    weak = rig("back_emf", stall=0.1, no_load=0.02)
    highest = 0.1 / (1.0 + 0.1 / 0.02)  # where what is left of the motor moves the guide's damping
    np.testing.assert_allclose(np.max(-np.diff(weak.q, axis=1)) / 0.04, highest, rtol=0.05)
    ringing = rig("swinging_load", share=1.0, frequency=4.0)
    np.testing.assert_allclose(ringing.q[0, NUDGE], plain.q[0, NUDGE], atol=2e-4)
    late = rig("stale_velocity", window=0.03)
    np.testing.assert_allclose(late.q[0, NUDGE], plain.q[0, NUDGE], atol=2e-4)  # damped late, it rings
    assert np.abs(late.q[:, NEAR : NEAR + 5] - plain.q[:, NEAR : NEAR + 5]).max() > 1e-4
    lagging = rig("actuator_lag", time_constant=0.05)
    assert np.all(lagging.q[:, NEAR + 1 : NEAR + 5] > plain.q[:, NEAR + 1 : NEAR + 5])
    np.testing.assert_allclose(lagging.q[0, settled], plain.q[0, settled], atol=2e-5)
    limited = rig("force_limit", limit=0.05)
    swings = limited.f[0, EASE - 8 : EASE]  # a pad bounces long on an object that is damped so little
    np.testing.assert_allclose(swings.mean(axis=0), 0.05 * F_ALPHA, rtol=0.1)
    assert np.all(plain.f[0, EASE] > 0.06 * F_ALPHA)


def test_symptoms_between_motor_and_pad() -> None:
    plain = rig()
    play = rig("backlash", gap=2e-4)
    assert np.all(plain.f[0, EASE] - plain.f[0, RELEASE] > 0.02)
    np.testing.assert_allclose(play.f[0, EASE], play.f[0, RELEASE], atol=0.004)  # the play eats the easing
    loose, behind = rig("backlash_loose", gap=5e-4), rig("backlash_behind", gap=5e-4)
    assert np.all(loose.f[0, EASE] < plain.f[0, EASE] - 0.05)  # the motor takes the play before it presses,
    np.testing.assert_allclose(behind.q[0, EASE], plain.q[0, EASE], atol=3e-5)  # if it doesn't know of it
    np.testing.assert_allclose(behind.f[0, EASE], plain.f[0, EASE], atol=0.01)
    bent = rig("finger_compliance", compliance=1e-3)
    np.testing.assert_allclose(bent.q[0, SQUEEZE], plain.q[0, SQUEEZE], atol=2e-5)  # no load, no bending
    assert np.all(bent.q[:, EASE] < plain.q[:, EASE] - 2e-5)


def test_symptoms_of_contact_and_object() -> None:
    plain, touched = rig(), SQUEEZE + 8
    assert np.all(rig("stiffening_contact").q[:, EASE] > plain.q[:, EASE])

    def decay(recording) -> np.ndarray:
        return recording.f[0, touched] - recording.f[0, EASE]

    assert np.all(decay(rig("viscoelastic_contact")) > decay(plain) + 0.005)
    assert np.min(rig("adhesion", "large").f) < -0.05
    assert np.min(plain.f) >= 0
    pushed = abs(rig().o[1, EASE] - OFFSET)
    assert abs(rig("object_friction", level=0.05).o[1, EASE] - OFFSET) < pushed - 1e-4
    slid = [abs(rig("contact_friction", share=share).o[1, EASE] - OFFSET) for share in (0.5, 2.0)]
    assert slid[0] > pushed + 1e-4 > pushed - 1e-4 > slid[1]


@pytest.mark.long
def test_symptoms_of_the_sensors() -> None:
    plain = rig()
    for name in CATALOGUE:
        if name.startswith("force_") and name != "force_limit":
            np.testing.assert_array_equal(rig(name, "large", pace=2).q, rig(pace=2).q)
    np.testing.assert_allclose(rig("force_delay", latency=0.08).f[:, 2:], plain.f[:, :-2], atol=1e-12)
    rising = plain.f > np.roll(plain.f, 1, axis=1) + 0.01
    assert np.all(rig("force_lag").f[rising] < plain.f[rising])
    np.testing.assert_allclose(rig("force_bias", left=0.1, right=0.2).f - plain.f, np.full_like(plain.f, [0.1, 0.2]))
    drift = rig("force_drift", left=0.1, right=0.0).f - plain.f
    np.testing.assert_allclose(drift[:, -1], [[0.1 * (END - 1) * 0.04, 0.0]] * 2)
    np.testing.assert_allclose(rig("force_deadzone", threshold=0.1).f, np.maximum(plain.f - 0.1, 0.0), atol=1e-12)
    np.testing.assert_allclose(rig("force_saturation", full_scale=0.1).f, np.minimum(plain.f, 0.1))
    ring = rig("force_hysteresis", spread=0.2).f
    peak = np.argmax(plain.f[0, :, 0])
    np.testing.assert_allclose(ring[0, :peak], plain.f[0, :peak])  # loading
    assert np.all(ring[0, RELEASE] > 1.05 * plain.f[0, RELEASE])  # unloading
    np.testing.assert_allclose(rig("force_crosstalk", share=0.1).f, plain.f + 0.1 * plain.f[:, :, ::-1])
    np.testing.assert_allclose(rig("force_gain_asymmetry", right_excess=0.1).f, plain.f * [1.0, 1.1])
    bias = rig("encoder_bias", left=1e-4, right=0.0)
    np.testing.assert_allclose(bias.q - plain.q, np.full_like(plain.q, [1e-4, 0.0]))
    skewed = rig("readout_skew", age=0.08)
    np.testing.assert_allclose(skewed.q[:, 2:], plain.q[:, :-2], atol=1e-12)
    np.testing.assert_array_equal(skewed.f, plain.f)
    few = rig("quantisation", "large")
    assert len(np.unique(few.f.round(9))) < 6


@pytest.mark.parametrize("name", sorted(NOISES))
def test_noises(name: str) -> None:
    drawn = NOISES[name](np.random.default_rng(0), (2, 100, 50, 2))
    sizes = {"none": 0.0, "louder": 1.5, "quieter": 0.7, "outliers": np.sqrt(1 + 63 / 300)}
    assert np.std(drawn) == pytest.approx(sizes.get(name, 1.0), rel=0.15)
    after = np.corrcoef(drawn[..., 1:, :].ravel(), drawn[..., :-1, :].ravel())[0, 1] if name != "none" else 0.0
    assert after == pytest.approx(0.7 if name == "slow" else 0.0, abs=0.03)
    assert (np.abs(drawn).max() > 7) == (name in ("heavy", "outliers"))


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Callable[[str], dict[str, list[dict[str, str]]]]:
    """What a set holds that was spoiled so, by file."""

    @cache
    def read(spoiled: str) -> dict[str, list[dict[str, str]]]:
        folder = tmp_path_factory.mktemp("spoiled") / "set"
        record(folder, {}, 3, grasps=6, contact="penalty", samples=40, spoiled=spoiled)
        files = ("grasps.csv", "samples.csv")
        return {file: list(csv.DictReader((folder / file).read_text().splitlines())) for file in files}

    return read


@pytest.mark.parametrize("name", [*sorted(SPOILED), "clock_doubled+tare"])
def test_a_spoiled_set_differs_in_what_is_written_alone(name: str, written) -> None:
    def columns_that_differ(file: str) -> set[str]:
        pairs = zip(written("")[file], written(name)[file], strict=True)
        return {column for whole, other in pairs for column in whole if whole[column] != other[column]}

    expected = {
        "": set(), "clock_doubled": {"t_s"}, "forces_swapped": {"f_l_n", "f_r_n"}, "forces_late": {"f_l_n", "f_r_n"},
        "homed_anew": {"qdes_l_m", "qdes_r_m", "q_l_m", "q_r_m"}, "tared_anew": {"f_l_n", "f_r_n"},
        "commands_late": {"qdes_l_m", "qdes_r_m"}, "tare": {"f_l_n"}, "calliper": {"object_radius_m"},
        "radius_0.3mm": {"object_radius_m"}, "radius_2mm": {"object_radius_m"}, "one_radius": {"object_radius_m"},
        "labels_swapped": {"object", "object_radius_m"}, "positions_swapped": {"q_l_m", "q_r_m"},
        "clock_doubled+tare": {"t_s", "f_l_n"},
    }  # fmt: skip
    assert columns_that_differ("grasps.csv") | columns_that_differ("samples.csv") == expected[name]


def test_jitter_moves_readings_a_little() -> None:
    plain, late = (simulate(little_setup(), {}, contact="penalty", noise="none", jitter_s=j) for j in (0.0, 0.0015))
    assert 1e-6 < np.max(abs(plain.q - late.q)) < 1e-3


def test_scene_constants() -> None:
    for servo in (Servo(), None):
        model = compile_model(0.005, 0.025, 0.0, servo)
        assert model.body("object").invweight0[0] == pytest.approx(2.5)
        for name in ("left", "right"):
            assert model.body(name).invweight0[0] == pytest.approx(1.58745, rel=1e-5)
        assert model.dof_invweight0[-1] == pytest.approx(4.76236, rel=1e-5)


def test_motor_outside_mujoco_is_the_same_motor() -> None:
    """Where something gives way, the motor is integrated here: with next to no play it must move the same."""
    setup = draw_setup(5, 2, "rich", 40)
    plain, stiff = (
        simulate(setup, build_effects(chosen), contact="mujoco", noise="none")
        for chosen in ({}, {"backlash": {"gap": 1e-9}})
    )
    assert np.max(abs(stiff.q - plain.q)) < 3e-5


def test_record(tmp_path: Path) -> None:
    folders = [tmp_path / name for name in ("a", "b", "c")]
    for folder, seed in zip(folders, (1, 1, 2), strict=True):
        truth = record(folder, {"force_lag": "small"}, seed, grasps=4, contact="penalty", samples=50)
    first, again, other = ((folder / "samples.csv").read_text() for folder in folders)
    assert first == again != other
    assert sorted(p.name for p in folders[0].iterdir()) == ["grasps.csv", "meta.yaml", "samples.csv"]
    assert json.loads((tmp_path / "c.truth.json").read_text())["effects"] == truth.effects
    assert truth.effects == {"force_lag": {"time_constant": 0.01}}
    assert yaml.safe_load((folders[0] / "meta.yaml").read_text())["format"] == "forcegrasp-measurements/1"
    rows = list(csv.DictReader(first.splitlines()))
    assert len(rows) == 4 * 50
    assert all(0 <= float(row["qdes_l_m"]) <= 0.045 for row in rows)


def test_one_more_grasp_is_of_the_same_hand_and_object(tmp_path: Path) -> None:
    samples = 60
    truth = record(tmp_path / "set", {"force_lag": "large"}, 3, grasps=4, samples=samples)
    setup = draw_setup(3, 4, "rich", samples)
    thing = setup.things[setup.thing[2]].name
    record_one_more(tmp_path / "more", truth, thing, float(setup.offset[2]), setup.commands[2], noise_seed=4)
    (row,) = csv.DictReader((tmp_path / "more" / "grasps.csv").read_text().splitlines())
    assert row["object"] == thing
    all_rows, more = (
        np.loadtxt(tmp_path / name / "samples.csv", delimiter=",", skiprows=1) for name in ("set", "more")
    )
    before = all_rows[all_rows[:, 0] == 2]
    np.testing.assert_array_equal(before[:, 1:4], more[:, 1:4])  # time and commands
    for columns, std in ((slice(4, 6), POSITION_STD_M), (slice(6, 8), FORCE_STD_N)):
        off = (more - before)[:, columns]
        assert np.std(off) == pytest.approx(2**0.5 * std, rel=0.2)
        assert np.max(np.abs(off)) < 8 * std


@pytest.mark.parametrize(("contact", "plan"), [*((name, "rich") for name in PLANTS), ("penalty", "close_and_hold")])
def test_tiers_and_plans(contact: str, plan: str) -> None:
    recording = simulate(draw_setup(2, 2, plan, 60), {}, contact=contact, noise="none")
    assert recording.f.max() > 0.01
    assert -1e-3 < recording.q.min() < recording.q.max() < 0.046


def test_authors_trajectory() -> None:
    folder = Path(os.environ.get("FORCEGRASP_REFERENCE") or Path(__file__).parents[3] / "shared" / "reference")
    if not (folder / "kappa_0.50.csv").exists():
        pytest.skip(f"no reference in {folder}: set FORCEGRASP_REFERENCE")
    theirs = np.genfromtxt(folder / "kappa_0.50.csv", delimiter=",", names=True)
    commands, q, f = (
        np.stack([theirs[name.format(side)] for side in "lr"], 1) for name in ("qdes_{}_m", "q_{}_m", "f_{}_n")
    )
    commands = np.concatenate([commands, commands[-1:]])[None]  # their rows are what follows a command
    things = [Thing("kappa_0.50", 0.035, 0.0065, 2.75)]
    setup = Setup(Servo(100.0, -9.0), things, np.array([0]), np.array([0.0]), np.array([1]), commands)
    ours = simulate(setup, {}, noise="none")
    assert np.mean(abs(ours.q[0, 1:] - q)) < 2e-5
    assert np.mean(abs(ours.f[0, 1:] - f)) < 5e-3
