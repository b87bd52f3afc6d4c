"""Replays: held commands, stepped a second time by hand; the same numbers whatever else is replayed beside them."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path

import numpy as np
import pytest

from forcegrasp.effects import Effect, catalogue, get_effect
from forcegrasp.errors import PhysicsError
from forcegrasp.measure import MeasuredGrasp
from forcegrasp.physics import plant
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant, write_base
from forcegrasp.replay import replay
from forcegrasp.replay.replay import EffectOn, Replay

TIAGO = load_gripper("tiago")
OPEN_M = TIAGO.stroke
SECOND = Path(__file__).parents[1] / "grippers" / "second.yaml"
CASES = [pytest.param(e, v, id=f"{e.name}-{v}".rstrip("-")) for e in catalogue().values() for v in e.variants]
BASE = {"position_gain": 90.0, "velocity_gain": -8.0, "rho_m": 0.005, "radius_m": 0.03, "offset_m": 0.002}
SCALE = 1.7


def grasp(time: np.ndarray, name: str = "g", position_m: np.ndarray | None = None) -> MeasuredGrasp:
    """Closes from 32 mm in steps, holds, opens; the right finger commands a bit less. Nothing is measured."""
    left = np.interp(time - time[0], [0.0, 0.05, 0.3, 0.5, 0.6, 1.0], [0.032, 0.032, 0.026, 0.026, 0.029, 0.034])
    command = np.stack([left, left + 0.0004], axis=1)
    position = np.repeat(command[:1], len(time), axis=0) if position_m is None else position_m
    return MeasuredGrasp(name, "o", "", None, None, None, time, command, position, 0 * command, None)


REGULAR = np.arange(20) * 0.04
TIMES = {
    "25 Hz": REGULAR,
    "100 Hz": np.arange(80) * 0.01,
    "30 Hz, between physics steps": np.arange(24) / 30,
    "jitter": REGULAR + np.random.default_rng(0).uniform(-0.015, 0.015, 20) * (REGULAR > 0),
    "a little jitter": REGULAR + np.random.default_rng(0).uniform(-0.003, 0.003, 20) * (REGULAR > 0),
    "gap": REGULAR[[0, 1, 2, 3, 4, 5, 12, 13, 14, 19]],
    "late clock": 1.7e9 + REGULAR,
}
# What physics steps must be of to divide 1/30 s: 17 of 2 ms, 4 of 8 ms.
DIVIDED = {"reference": 0.034, "fast": 0.032}


def by_hand(
    one: MeasuredGrasp, *effects: tuple[type[Effect], str, np.ndarray], tier: str = "fast", factor: float = 1.0,
    uneven: bool = False,
) -> np.ndarray:  # fmt: skip
    """Position, force and object at each sample, read before that sample's command acts; ``(samples, 5)``.

    Where samples are uneven there are as many steps as usual between any two, which share the time.
    """
    plant, row = Plant(TIAGO, 1, tier, threads=1, step_factor=factor), np.array([0])
    acting = [kind(values[None], plant.dt, variant) for kind, variant, values in effects]
    plant.attach([(effect, row) for effect in acting])
    start = one.command_m[:1]
    for effect in acting:
        start = np.clip(effect.rests_at(start), 0, TIAGO.stroke)
    base = {name: np.array([value]) for name, value in (BASE | {"force_scale": SCALE}).items()}
    plant.reset(row, write_base(plant, row, base), start)
    real = (one.time_s - one.time_s[0]) / plant.dt
    steps = np.full(len(real) - 1, round(REGULAR[1] / plant.dt)) if uneven else np.diff(np.rint(real)).astype(int)
    seen = []
    for index, command in enumerate(one.command_m):
        seen.append([*plant.measured_position[0], *plant.measured_force[0], plant.object_position[0]])
        if index < len(steps):
            if uneven:
                plant.stretch_steps(np.diff(real)[index : index + 1] / steps[index])
            plant.advance(command[None], steps[index])
    return np.array(seen)


def of_whole_steps(effect: type[Effect], simulator: Replay) -> np.ndarray:
    """Typical values, times as whole steps: a plant has no parts of a step, but what a replay puts off to readings."""
    return effect.at_whole_steps(effect.typical_values()[None], simulator.dt)[0][0]


def replayed(simulator: Replay, rows: np.ndarray, *effects: EffectOn, base: dict | None = None) -> np.ndarray:
    """The same by replay, ``(rows, samples, 5)``."""
    numbers = {name: np.full(len(rows), value) for name, value in BASE.items()} | (base or {})
    motion = simulator.simulate(rows, numbers, [e for e in effects if not e.effect.reads_only(e.variant)])
    readings = simulator.read(
        motion, np.arange(len(rows)), np.full(len(rows), SCALE), [e for e in effects if e.effect.reads()]
    )
    return np.concatenate([readings.position, readings.force, readings.object_position[..., None]], axis=-1)


@pytest.mark.parametrize("name", TIMES)
@pytest.mark.parametrize("tier", ["fast", "reference"])
def test_commands_are_held_from_their_time_stamp(name, tier):
    one = grasp(TIMES[name])
    simulator = Replay(TIAGO, [one], tier)
    factor = simulator.dt / float(TIAGO.compile(tier).opt.timestep)
    uneven = name == "a little jitter"
    expected = 1 / 30 / DIVIDED[tier] if name.startswith("30 Hz") else 1.0
    assert factor == pytest.approx(expected, rel=0.1 if uneven else 1e-12)
    seen = by_hand(one, tier=tier, factor=simulator._step_factor, uneven=uneven)
    assert replayed(simulator, np.array([0]))[0].tobytes() == seen.tobytes()
    assert seen[:, 2:4].max() > 0.05 or name == "gap"


@pytest.mark.parametrize("slower", [0.997, 1.003, 1.02])
def test_a_clock_that_is_a_little_off_moves_no_sample_between_steps(slower):
    """Rows a little further apart are as many steps apart, each a little longer, and the motion is nearly the same."""
    exact, off = (Replay(TIAGO, [grasp(factor * REGULAR)]) for factor in (1.0, slower))
    assert off.dt == pytest.approx(slower * exact.dt)
    assert np.array_equal(off.sample_steps, exact.sample_steps)
    one, other = (replayed(simulator, np.array([0])) for simulator in (exact, off))
    assert np.abs(one - other)[..., :2].max() < 0.02 * abs(slower - 1)


def test_steps_that_divide_no_period_stay_as_they_are():
    assert Replay(TIAGO, [grasp(np.arange(80) * 0.003)]).dt == Replay(TIAGO, [grasp(REGULAR)]).dt


@pytest.mark.parametrize("late_s", [(-0.003, -0.003), (0.0, -0.005), (0.007, 0.002)])
def test_late_readings_are_those_of_the_motion_at_that_time(late_s):
    one = dataclasses.replace(grasp(REGULAR), late_s=late_s)
    simulator = Replay(TIAGO, [one])
    motion = simulator.simulate(np.array([0]), {name: np.full(1, value) for name, value in BASE.items()})
    skews = [np.array([late]) for late in late_s]
    read = simulator.read(motion, np.array([0]), np.array([SCALE]), (), *skews)
    moments = simulator.dt * np.arange(motion.position.shape[1])
    for finger in range(2):
        position = np.interp(REGULAR + late_s[0], moments, motion.position[0, :, finger])
        force = np.interp(REGULAR + late_s[1], moments, SCALE * motion.force[0, :, finger])
        np.testing.assert_allclose(read.position[0, :, finger], position, atol=1e-12)
        np.testing.assert_allclose(read.force[0, :, finger], force, atol=1e-12)
    assert moments[-1] >= REGULAR[-1] + max(late_s) - 1e-9


@pytest.mark.parametrize(("effect", "variant"), CASES)
def test_effects_act_as_they_do_live(effect, variant):
    """Sensors are read after the simulation, those of the command see what is new: all as on a plant."""
    one = grasp(TIMES["jitter"])
    simulator = Replay(TIAGO, [one], "fast", encoders_known=False)
    values = of_whole_steps(effect, simulator)
    on = EffectOn(effect, variant, values[None], np.array([0]))
    assert replayed(simulator, np.array([0]), on)[0].tobytes() == by_hand(one, (effect, variant, values)).tobytes()


@pytest.mark.parametrize("delay_s", [0.005, 0.0513])
@pytest.mark.parametrize("tier", ["fast", "reference"])
def test_a_delay_of_a_part_of_a_step_is_as_exact_as_none_though_motors_are_at_their_limit(tier, delay_s):
    """To a command of half the way, a motor at its limit gives as much as to one of the whole way."""
    stepped = np.where(REGULAR < 0.1, OPEN_M, np.where(REGULAR < 0.5, 0.005, OPEN_M))
    one = dataclasses.replace(grasp(REGULAR), command_m=np.repeat(stepped[:, None], 2, axis=1))

    def off(delay_s: float) -> float:
        """Rms by which the motors stand elsewhere than with steps of 0.1 ms, of which the delay is a multiple."""
        delay = EffectOn(get_effect("command_delay"), "", np.array([[delay_s]]), np.array([0]))
        coarse, fine = Replay(TIAGO, [one], tier), Replay(TIAGO, [one], "reference", step_factor=0.05)
        seen = [replayed(simulator, np.array([0]), delay)[0, :, :2] for simulator in (coarse, fine)]
        return float(np.sqrt(np.mean((seen[0] - seen[1]) ** 2)))

    assert off(delay_s) < 1.1 * off(0.0)


@pytest.mark.parametrize(("effect", "variant"), CASES)
def test_what_follows_from_commands_or_is_alike_in_each_step_needs_no_stop_there(effect, variant, monkeypatch):
    def stopped(*_):
        raise AssertionError

    monkeypatch.setattr(Plant, "advance", stopped)
    simulator = Replay(TIAGO, [grasp(REGULAR)], "fast")
    one = EffectOn(effect, variant, effect.typical_values()[None], np.array([0]))
    if variant in effect.known_beforehand or effect.acts_alike:
        assert replayed(simulator, np.array([0]), one).any()
    elif effect.hooks() & {"command", "act", "motor_range", "interaction"} and not effect.reads_only(variant):
        with pytest.raises(AssertionError):
            replayed(simulator, np.array([0]), one)


def test_several_effects_act_in_their_order():
    one = grasp(REGULAR)
    chosen = [get_effect(n) for n in ("quantisation", "force_bias", "force_lag", "backlash", "command_delay")]
    simulator = Replay(TIAGO, [one], "fast", encoders_known=False)
    on = [EffectOn(e, "", of_whole_steps(e, simulator)[None], np.array([0])) for e in chosen]
    seen = replayed(simulator, np.array([0]), *on)[0]
    assert seen.tobytes() == by_hand(one, *((e, "", of_whole_steps(e, simulator)) for e in chosen)).tobytes()


@pytest.mark.parametrize("sample", [3, 9])
def test_a_reading_is_taken_before_its_command_acts(sample):
    one = grasp(REGULAR)
    command = one.command_m.copy()
    command[sample:] = 0.04
    other = dataclasses.replace(one, command_m=command)
    first, second = replayed(Replay(TIAGO, [one, other], "fast"), np.arange(2))
    assert np.array_equal(first[: sample + 1], second[: sample + 1])
    assert np.all(first[sample + 1, :2] != second[sample + 1, :2])


def test_grasps_of_different_lengths_and_rates():
    grasps = [grasp(t, n) for n, t in TIMES.items()]
    simulator = Replay(TIAGO, grasps, "fast")
    together = replayed(simulator, np.arange(len(grasps)))
    longest = max(len(g.time_s) for g in grasps)
    assert together.shape == (len(grasps), longest, 5)
    assert simulator.dt == Replay(TIAGO, grasps[:1], "fast").dt
    for index, one in enumerate(grasps):
        count = len(one.time_s)
        assert simulator.mask[index].tolist() == [True] * count + [False] * (longest - count)
        assert together[index, :count].tobytes() == by_hand(one).tobytes()
        assert np.all(together[index, count:] == together[index, count - 1])  # its last reading again


@pytest.mark.parametrize("effect", ["none", "viscoelastic_contact"])
def test_a_grasp_that_is_over_stands_still(effect, monkeypatch):
    """In one call of the engine, and step by step; what is simulated of it until then is what it is by itself."""
    monkeypatch.setattr(plant, "_NUMBERS_AT_ONCE", 1)
    short, whole = grasp(REGULAR[:10]), grasp(REGULAR)  # it ends on its way in
    one = get_effect(effect)
    on = [EffectOn(one, "", np.tile(one.typical_values(), (rows, 1)), np.arange(rows)) for rows in (1, 2)]
    alone, both = Replay(TIAGO, [short], "fast"), Replay(TIAGO, [short, whole], "fast")
    by_itself, beside = alone.simulate(np.arange(1), {}, on[:1]), both.simulate(np.arange(2), {}, on[1:])
    without = both.simulate(np.arange(1), {}, on[:1])  # the longer one is not asked for
    steps = by_itself.position.shape[1]
    for name in ("position", "force", "object_position"):
        expected = getattr(by_itself, name)[0]
        for motion in (beside, without):
            made = getattr(motion, name)[0]
            assert made[:steps].tobytes() == expected.tobytes()
            assert len(made) > steps
            assert (made[steps:] == expected[-1]).all()
    assert (np.ptp(beside.position[1, steps:], axis=0) > 0).all()


@functools.cache
def many() -> tuple[Replay, np.ndarray, tuple[EffectOn, ...], dict[str, np.ndarray]]:
    """Nine rows of three grasps, each with its own gain, effects on some of them."""
    grasps = [grasp(REGULAR), grasp(TIMES["gap"]), grasp(TIMES["100 Hz"])]
    rows = np.array([0, 1, 2, 2, 1, 0, 0, 1, 2])
    bias, delay, viscous = map(get_effect, ("force_bias", "command_delay", "viscoelastic_contact"))
    effects = (
        EffectOn(bias, "", np.array([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]]), np.array([1, 4, 8])),
        EffectOn(delay, "", np.array([[0.01], [0.02], [0.03], [0.045]]), np.array([0, 4, 5, 7])),
        EffectOn(viscous, "", np.array([[300.0, 0.2]]), np.array([8])),
    )
    return Replay(TIAGO, grasps, "fast"), rows, effects, {"position_gain": np.linspace(80, 110, 9)}


@pytest.mark.parametrize("rows_at_once", [1, 2, 4])
def test_chunks_change_no_bit(rows_at_once, monkeypatch):
    simulator, rows, effects, base = many()
    whole = replayed(simulator, rows, *effects, base=base)
    monkeypatch.setattr(replay, "_CHUNK", rows_at_once * simulator._steps)
    assert replayed(simulator, rows, *effects, base=base).tobytes() == whole.tobytes()


def test_rows_are_as_if_alone():
    simulator, rows, effects, base = many()
    whole = replayed(simulator, rows, *effects, base=base)
    for row in range(len(rows)):
        mine = []
        for e in effects:
            at = np.flatnonzero(e.rows == row)
            if len(at):
                mine.append(EffectOn(*e.kind, e.values[at], np.array([0])))
        alone = replayed(simulator, rows[[row]], *mine, base={n: v[[row]] for n, v in base.items()})
        assert alone[0].tobytes() == whole[row].tobytes()


def test_one_motion_is_read_in_several_ways():
    simulator = Replay(TIAGO, [grasp(REGULAR), grasp(TIMES["gap"])], "fast")
    motion = simulator.simulate(np.arange(2), {name: np.full(2, value) for name, value in BASE.items()})
    bias = EffectOn(get_effect("force_bias"), "", np.array([[0.1, -0.2]]), np.array([1]))
    readings = simulator.read(motion, np.array([0, 0, 1, 0]), np.array([1.0, 1.0, 2.0, 3.0]), [bias])
    assert np.array_equal(readings.position[0], readings.position[3])
    assert readings.force[3] == pytest.approx(3 * readings.force[0], rel=1e-12)
    assert readings.force[1] - readings.force[0] == pytest.approx(np.full((20, 2), [0.1, -0.2]), abs=1e-12)
    alone = simulator.read(motion, np.array([1]), np.array([2.0]))
    assert np.array_equal(alone.force[0], readings.force[2])
    assert np.array_equal(alone.object_position[0], readings.object_position[2])


def test_a_drivers_dead_band_goes_by_the_recorded_encoder():
    """Where a grasp was recorded, the driver decided by what its encoder said then, not by what we simulate."""
    dead = EffectOn(get_effect("command_deadband"), "position", np.array([[0.003]]), np.array([0]))
    one = grasp(REGULAR)
    at_command = grasp(REGULAR, position_m=one.command_m.copy())  # recorded as being there already: nothing is sent
    far = grasp(REGULAR, position_m=one.command_m + 0.01)

    def moved(measured: MeasuredGrasp, known: bool) -> float:
        seen = replayed(Replay(TIAGO, [measured], "fast", encoders_known=known), np.array([0]), dead)[0]
        return float(np.abs(seen[:, :2] - measured.command_m[0]).max())

    assert moved(at_command, True) == pytest.approx(0, abs=1e-9)
    assert moved(far, True) > 0.003
    assert moved(at_command, False) == moved(one, False) > 0.003


def test_half_the_step_reads_at_the_same_times():
    one = grasp(TIMES["jitter"])
    whole, half = Replay(TIAGO, [one]), Replay(TIAGO, [one], step_factor=0.5)
    assert half.dt == whole.dt / 2
    assert np.abs(half.sample_steps * half.dt - whole.sample_steps * whole.dt).max() <= whole.dt / 2 + 1e-12
    first, second = replayed(whole, np.array([0])), replayed(half, np.array([0]))
    assert not np.array_equal(first, second)
    assert first[..., :2] == pytest.approx(second[..., :2], abs=3e-4)


def test_the_other_collision_code_is_another_one():
    one = grasp(REGULAR)
    seen = [replayed(Replay(TIAGO, [one], other_collisions=o), np.array([0]))[0] for o in (False, True)]
    assert not np.array_equal(*seen)
    assert seen[0][:, :2] == pytest.approx(seen[1][:, :2], abs=1e-4)


def test_divergence_names_the_grasp_and_its_parameters():
    simulator = Replay(TIAGO, [grasp(REGULAR, "good"), grasp(REGULAR, "bad")], "fast", strict=True)
    base = {name: np.full(2, value) for name, value in BASE.items()} | {"velocity_gain": np.array([-8.0, 1e9])}
    with pytest.raises(PhysicsError, match=r"grasp bad diverged with .*velocity_gain=1e\+09"):
        simulator.simulate(np.arange(2), base)


def test_another_gripper():
    second = load_gripper(str(SECOND))
    one = grasp(REGULAR)
    nominal = {n: np.array([p.nominal]) for n, p in second.parameters.items() if n != "force_scale"}
    simulator = Replay(second, [one])
    motion = simulator.simulate(np.array([0]), nominal)
    assert motion.position[0, 0] == pytest.approx(one.command_m[0])
    assert motion.position[0].min() < 0.03
