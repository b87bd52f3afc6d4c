"""Zeros that differ from session to session are told, and no effect is made up for them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.diagnosis.faults.session_zeros import SessionZeros, session_zeros
from forcegrasp.diagnosis.faults.wrong_zeros import wrong_zeros
from forcegrasp.identify.fit_set import apply_model, fit_model
from forcegrasp.identify.loading import Loaded
from forcegrasp.measure.schema import MeasuredGrasp
from tests.diagnosis.test_faults_of_the_set import changed, silent, with_model
from tests.light_set import light_set

#: By how much the zero of each session is off: of two encoders, m, and of two force sensors, N.
OFF_M = {"1": (3e-4, -2e-4), "2": (-1e-4, 2e-4), "3": (-2e-4, 0.0)}
OFF_N = {name: tuple(150 * x for x in off) for name, off in OFF_M.items()}


def encoders(grasp: MeasuredGrasp, off) -> MeasuredGrasp:
    """Encoders read as much more; the servo does not go by them."""
    return dataclasses.replace(grasp, position_m=grasp.position_m + off)


def homed(grasp: MeasuredGrasp, off) -> MeasuredGrasp:
    """Fingers were homed elsewhere: they stand elsewhere than commands and encoders say."""
    return dataclasses.replace(encoders(grasp, off), command_m=grasp.command_m + off)


def forces(grasp: MeasuredGrasp, off) -> MeasuredGrasp:
    """Sensors were set to zero while something pressed."""
    return dataclasses.replace(grasp, force_n=grasp.force_n + off)


@pytest.fixture(scope="module")
def sound():
    """Nine grasps of three objects, three in each of three sessions, and the base model of them."""
    return with_model(light_set(seed=15))


@pytest.fixture(scope="module")
def found(sound) -> Callable[..., SessionZeros | None]:
    """What is found where grasps are changed by a function of the grasp, its place and its session."""
    loaded, model = sound
    places = {g.name: i for i, g in enumerate(loaded.measured.grasps)}

    def in_set(change, session=lambda i, grasp: str(1 + i // 3)) -> SessionZeros | None:
        def of_session(g: MeasuredGrasp) -> MeasuredGrasp:
            g = dataclasses.replace(g, session=session(places[g.name], g))
            return change(g, places[g.name])

        target, _, base = apply_model(changed(loaded, of_session), model, silent, refit=True)
        return session_zeros(target, base.fit)

    return in_set


@pytest.mark.parametrize(
    ("change", "off", "of", "exact"),
    [(encoders, OFF_M, "readings", 3e-5), (homed, OFF_M, "homing", 6e-5), (forces, OFF_N, "forces", 5e-3)],
)
def test_zeros_of_sessions_are_told_and_put_right(sound, found, change, off, of, exact):
    zeros = found(lambda g, _: change(g, off[g.session]))
    assert (zeros.of, zeros.sessions) == (of, ("1", "2", "3"))
    assert zeros.change == pytest.approx(np.array(list(off.values())), abs=exact)
    true = dataclasses.replace(sound[0].measured.grasps[0], session="1")
    right = zeros.taken_out(change(true, off["1"]))
    for name in ("command_m", "position_m", "force_n"):
        assert getattr(right, name) == pytest.approx(getattr(true, name), abs=exact)


@pytest.mark.parametrize(("change", "alike"), [(encoders, False), (homed, True)])
def test_what_all_sessions_have_in_common_is_taken_out_where_no_effect_stands_for_it(found, change, alike):
    more = np.array([2e-4, 1e-4])
    zeros = found(lambda g, _: change(g, OFF_M[g.session] + more))
    assert zeros.change == pytest.approx(np.array(list(OFF_M.values())) + alike * more, abs=6e-5)


@pytest.mark.parametrize("change", [encoders, homed])
def test_what_is_off_otherwise_is_not_told_as_of_sessions(found, change):
    """In all grasps alike, in each by chance, of an object that has a session of its own, or in too few grasps."""
    by_chance = np.random.default_rng(3).permutation(np.repeat(list(OFF_M.values()), 3, axis=0))
    assert found(lambda g, _: change(g, OFF_M["1"])) is None
    assert found(lambda g, i: change(g, by_chance[i])) is None
    own = {"thing_0": "1", "thing_1": "2", "thing_2": "3"}
    assert found(lambda g, _: change(g, OFF_M[g.session]), lambda i, g: own[g.object]) is None
    assert found(lambda g, i: change(g, OFF_M[str(1 + i // 3)]), lambda i, g: str(i)) is None


@pytest.mark.parametrize(
    ("off", "name"),
    [
        ({"1": 0.0, "2": 0.08, "3": 0.08}, "force_tare"),  # one change of zero, that two sessions share
        ({"1": 0.0, "2": 0.08, "3": -0.06}, "force_zeros"),
    ],
)
def test_one_change_of_zero_is_no_zero_of_each_session(sound, off, name):
    loaded, model = sound
    places = {g.name: i for i, g in enumerate(loaded.measured.grasps)}

    def of_session(g: MeasuredGrasp) -> MeasuredGrasp:
        session = str(1 + places[g.name] // 3)
        return forces(dataclasses.replace(g, session=session), [off[session], 0.0])

    tared = changed(loaded, of_session)
    target, _, base = apply_model(tared, model, silent, refit=True)
    assert [fault.name for fault in wrong_zeros(tared, target, base.fit)] == [name]


def test_words_say_by_how_much_each_differs_and_what_to_check():
    change = np.array([[3e-4, -2e-4], [1e-6, 0.0], [-3e-4, 2e-4]])
    zeros = SessionZeros("homing", ("mon", "tue", "wed"), change, 0.0)
    assert zeros.name == "position_zeros"
    assert zeros.words(("q_l_m", "q_r_m"), "m") == (
        "encoders and commands have another zero in each session: in mon q_l_m +0.3 mm, q_r_m -0.2 mm and in wed"
        " q_l_m -0.3 mm, q_r_m +0.2 mm, compared with what radii and places say"
    )
    assert "homed" in zeros.check
    of_forces = SessionZeros("forces", ("mon", "tue"), np.array([[0.02], [-0.02]]), 0.0)
    assert of_forces.name == "force_zeros"
    words = of_forces.words(("f_n",), "m")
    assert "in mon f_n +0.02 N" in words
    assert words.endswith("compared with the mean of all grasps")
    assert "open fingers" in of_forces.check


def homed_in_each_session(loaded: Loaded) -> Loaded:
    """The set, recorded in three sessions, before each of which the gripper was homed."""
    places = {g.name: i for i, g in enumerate(loaded.measured.grasps)}

    def of_session(g: MeasuredGrasp) -> MeasuredGrasp:
        session = str(1 + places[g.name] // 3)
        return homed(dataclasses.replace(g, session=session), OFF_M[session])

    return changed(loaded, of_session)


def test_a_diagnosis_puts_them_right(sound):
    loaded, model = sound
    diagnosis, _ = diagnose_set(homed_in_each_session(loaded), model, ["backlash"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("data", ("position_zeros",))
    assert diagnosis.error_after < 1.1 < diagnosis.error_before


@pytest.mark.long
def test_they_are_put_right_beside_an_effect_that_had_hidden_them():
    hidden = homed_in_each_session(light_set("command_delay delay_s=0.1", seed=15))
    target, _, base = fit_model(hidden, 0, silent)
    assert session_zeros(target, base.fit) is None
    diagnosis, _ = diagnose_set(hidden, None, ["command_delay", "encoder_bias"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("effect", ("position_zeros", "command_delay"))
    assert diagnosis.fit.effect("command_delay").values == pytest.approx([0.1], abs=2e-3)
    assert diagnosis.error_after < 1.1
