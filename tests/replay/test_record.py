"""Recorded sets: reproducible, true to what they were made of, and sets like any other."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path

import numpy as np
import pytest

from forcegrasp.effects import Effect, catalogue, get_effect
from forcegrasp.effects.for_gripper import effect_of, why_left_out
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.errors import ConfigError
from forcegrasp.measure import check_set, read_set, write_set
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.sensors import rounding_steps, with_noise
from forcegrasp.replay.plans import PERIOD_S, PLANS, SAMPLES
from forcegrasp.replay.record import Recorded, parse_effect, record
from forcegrasp.replay.replay import EffectOn, Replay
from tests.light_set import light_gripper

TIAGO = load_gripper("tiago")
SECOND = load_gripper(str(Path(__file__).parents[1] / "grippers" / "second.yaml"))
CASES = [pytest.param(e, v, id=f"{e.name}-{v}".rstrip("-")) for e in catalogue().values() for v in e.variants]


def make(gripper: Gripper = TIAGO, plan: str = "rich", effects: tuple[EffectSetting, ...] = (), **options) -> Recorded:
    """A small recording without noise, unless told otherwise."""
    usual = {"grasps": 2, "objects": 2, "known": {}, "off_nominal": 0.2, "position_std_m": 0.0, "force_std_n": 0.0}
    return record(gripper, plan, effects=effects, **usual | {"seed": 15} | options)


@functools.cache
def plain() -> Recorded:
    return make()


@functools.cache
def plain_and_light() -> Recorded:
    return make(light_gripper())


@functools.cache
def noisy() -> Recorded:
    return make(grasps=6, position_std_m=2.7e-5, force_std_n=0.013)


def signals(made: Recorded) -> np.ndarray:
    """``(grasps, samples, 4)``."""
    return np.array([np.concatenate([g.position_m, g.force_n], axis=1) for g in made.measured.grasps])


def replay_truth(made: Recorded, gripper: Gripper, effects: tuple[EffectSetting, ...]) -> np.ndarray:
    """The set's commands on a gripper with the true parameters and effects."""
    simulator, rows = Replay(gripper, made.measured.grasps), np.arange(len(made.measured.grasps))
    on = [EffectOn(*e.kind, np.repeat(e.values[None], len(rows), axis=0), rows) for e in effects]
    base = {name: values for name, values in made.base.items() if name != "force_scale"}
    motion = simulator.simulate(rows, base, [e for e in on if not e.effect.reads_only(e.variant)])
    readings = simulator.read(motion, rows, made.base["force_scale"], [e for e in on if e.effect.reads()])
    steps = rounding_steps((e.effect, e.values) for e in effects)
    pairs = zip((readings.position, readings.force), steps, strict=True)
    return np.concatenate([with_noise(values, 0.0, 0.0, step) for values, step in pairs], axis=-1)


@pytest.mark.parametrize("gripper", [TIAGO, SECOND], ids=["tiago", "second"])
def test_replay_with_the_true_parameters_is_the_recording(gripper):
    made = make(gripper)
    assert signals(made)[..., 2:].max() > 0.1
    assert replay_truth(made, gripper, ()).tobytes() == signals(made).tobytes()


def shows_on_light(effect: type[Effect], variant: str) -> bool:
    """On the gripper that is simulated in less time; but nothing rubs along its ball, which slides on a rail."""
    if effect.name in ("contact_friction", "table_friction") or why_left_out(effect, light_gripper()):
        return False
    return variant in effect_of(effect.name, light_gripper()).variants


@pytest.mark.parametrize(("effect", "variant"), CASES)
def test_every_effect_can_be_recorded_and_replayed(effect, variant):
    """The replay knows recorded positions only, not what happened; that is enough for every effect alone."""
    shows = shows_on_light(effect, variant)
    gripper, bare = (light_gripper(), plain_and_light()) if shows else (TIAGO, plain())
    effect = effect_of(effect.name, gripper) if shows else effect
    # the typical converter saturates beyond what this grasp presses
    strength = np.array([0.1, 0.0]) if effect.name == "force_saturation" else effect.typical_values()
    use = EffectSetting(effect, variant, strength)
    made = make(gripper, effects=(use,), grasps=1)
    assert signals(made).tobytes() != signals(bare)[:1].tobytes()
    assert replay_truth(made, gripper, (use,)).tobytes() == signals(made).tobytes()


def test_a_drivers_dead_band_goes_by_the_logged_positions():
    """Noise and all, so that who has the log knows which commands were dropped."""
    use = parse_effect("command_deadband threshold_m=0.0003")
    made = make(effects=(use,), position_std_m=5e-5)
    bare = dataclasses.replace(made, measured=make(effects=(use,)).measured)
    off = np.abs(replay_truth(made, TIAGO, (use,)) - signals(made))
    assert off[..., :2].max() < 5 * 5e-5
    assert off[..., 2:].max() < 1e-12
    assert np.abs(replay_truth(bare, TIAGO, (use,)) - signals(made))[..., 2:].max() > 1e-6  # noise decided somewhere


def test_null_values_change_no_bit():
    """Of all effects at once; tests/effects/test_effect_contract.py has them one by one."""
    nothing = tuple(EffectSetting(effect, "", effect.null_values()) for effect in catalogue().values())
    assert signals(make(light_gripper(), effects=nothing)).tobytes() == signals(plain_and_light()).tobytes()


def test_seed_decides_everything():
    again = make(grasps=6, position_std_m=2.7e-5, force_std_n=0.013)
    assert again.measured.fingerprint == noisy().measured.fingerprint
    assert signals(again).tobytes() == signals(noisy()).tobytes()
    other = make(grasps=6, position_std_m=2.7e-5, force_std_n=0.013, seed=4)
    assert other.measured.fingerprint != noisy().measured.fingerprint
    assert all((other.base[name] != value).any() for name, value in noisy().base.items())


def test_effects_and_noise_change_nothing_else():
    """The same seed grasps the same objects in the same way, so that sets can be compared."""
    lagging = make(
        effects=(EffectSetting(get_effect("force_lag"), "", np.array([0.1])),), position_std_m=1e-4, force_std_n=0.01
    )
    for one, other in zip(plain().measured.grasps, lagging.measured.grasps, strict=True):
        assert np.array_equal(one.command_m, other.command_m)
        assert (one.name, one.object, one.radius_m, one.offset_m) == (
            other.name,
            other.object,
            other.radius_m,
            other.offset_m,
        )
    assert all(np.array_equal(plain().base[name], value) for name, value in lagging.base.items())


def test_noise_is_white_and_of_its_size():
    noise = signals(noisy()) - signals(make(grasps=6))
    for pair, std in ((noise[..., :2], 2.7e-5), (noise[..., 2:], 0.013)):
        assert pair.std() == pytest.approx(std, rel=0.05)
        assert abs(pair.mean()) < 3 * std / np.sqrt(pair.size)
        neighbours = np.mean(pair[:, 1:] * pair[:, :-1]) / std**2
        assert abs(neighbours) < 0.1


def test_what_the_set_says_of_itself():
    measured = noisy().measured
    assert (measured.position_std_m, measured.force_std_n, measured.gripper) == (2.7e-5, 0.013, "tiago")
    assert "seed 15" in measured.source
    assert [g.object for g in measured.grasps] == ["object_1", "object_2"] * 3
    for g in measured.grasps:
        assert np.array_equal(g.time_s, np.arange(SAMPLES) * PERIOD_S)
        assert g.position_m[0] == pytest.approx([0.045] * 2, abs=2e-4)


@pytest.mark.parametrize("gripper", [TIAGO, SECOND], ids=["tiago", "second"])
def test_base_parameters_are_drawn_by_scope(gripper):
    made = make(gripper, grasps=6, objects=3, off_nominal=0.1)
    for name, p in gripper.parameters.items():
        values = made.base[name]
        assert values.shape == (6,)
        assert np.all((values >= p.low) & (values <= p.high))
        if p.scope == "gripper":
            assert len(set(values)) == 1
            assert 0 < abs(values[0] / p.nominal - 1) <= 0.1
        elif p.scope == "object":
            assert len(set(values)) == 3
            assert np.array_equal(values[:3], values[3:])
    assert [g.radius_m for g in made.measured.grasps] == made.base["radius_m"].tolist()
    assert [g.offset_m for g in made.measured.grasps] == made.base["offset_m"].tolist()


def test_known_parameters_and_nominal_ones():
    made = make(known={"position_gain": 61.0}, off_nominal=0.0, grasps=1)
    assert made.base["position_gain"] == [61.0]
    assert made.base["velocity_gain"] == [-9.0]


@pytest.mark.parametrize("plan", PLANS)
@pytest.mark.parametrize("gripper", [TIAGO, SECOND], ids=["tiago", "second"])
@pytest.mark.parametrize("samples", ["csv", "parquet"])
def test_recorded_sets_are_sets_like_any_other(plan, gripper, samples, tmp_path):
    made = make(gripper, plan, grasps=4, position_std_m=2.7e-5, force_std_n=0.013)
    named = dataclasses.replace(made.measured, path=tmp_path / "set", name="set")
    write_set(named, tmp_path / "set", samples=samples)
    read = read_set(tmp_path / "set")
    assert read.fingerprint == made.measured.fingerprint
    assert check_set(read, load_gripper(read.gripper, read.path).stroke) == []
    for one, other in zip(read.grasps, made.measured.grasps, strict=True):
        assert all(np.array_equal(values, other.signals()[name]) for name, values in one.signals().items())


def test_quantisation_rounds_the_noise_too():
    steps = np.array([1e-4, 0.04])
    made = make(
        effects=(EffectSetting(get_effect("quantisation"), "", steps),), position_std_m=2.7e-5, force_std_n=0.013
    )
    for values, step in ((signals(made)[..., :2], steps[0]), (signals(made)[..., 2:], steps[1])):
        assert values / step == pytest.approx(np.round(values / step), abs=1e-6)
    free = signals(made)[:, :10, 2:]  # noise alone would not reach half a step often
    assert set(np.unique(np.round(free / 0.04))) <= {-1, 0, 1}


# --- effects by word -----------------------------------------------------------------------------------------------


def test_effects_by_word():
    backlash, compliance, bias = map(get_effect, ("backlash", "finger_compliance", "force_bias"))
    for text, effect, variant, values in (
        ("backlash", backlash, "play", [0.0006]),
        ("backlash loose", backlash, "loose", [0.0006]),
        ("  backlash   gap_m=0.001  command ", backlash, "command", [0.001]),
        ("finger_compliance compliance_m_n=2e-3", compliance, "", [0.002]),
        ("force_bias right_n=-0.1", bias, "", [bias.parameters[0].typical, -0.1]),
        ("force_bias left_n=0 right_n=0", bias, "", [0.0, 0.0]),
        ("none", get_effect("none"), "", []),
    ):
        parsed = parse_effect(text, TIAGO)
        assert parsed.kind == (effect, variant)
        assert parsed.values.tolist() == values
    infinite = [(e, p) for e in catalogue().values() for p in e.parameters if np.isinf(p.null)]
    assert infinite
    for effect, p in infinite:  # null values lie beyond the bounds, and may be given all the same
        assert np.isinf(parse_effect(f"{effect.name} {p.name}=inf", TIAGO).values).any()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "no such effect"),
        ("backlsh", "did you mean backlash"),
        ("backlash gap=1", "backlash has no 'gap'; did you mean gap_m"),
        ("backlash lose", "backlash has no 'lose'; did you mean loose"),
        ("backlash gap_m", "backlash has no 'gap_m'"),
        ("backlash gap_m=", "gap_m=: must be a number in m"),
        ("backlash gap_m=wide", "gap_m=wide: must be a number in m"),
        ("backlash gap_m=nan", "must lie in [0, 0.006] m"),
        ("backlash gap_m=-0.001", "must lie in [0, 0.006] m"),
        ("backlash gap_m=inf", "must lie in [0, 0.006] m"),
        ("backlash =0.001", "backlash has no ''"),
        ("force_bias loose", "force_bias has no 'loose'; "),
        ("none x=1", "none has no 'x'"),
    ],
)
def test_wrong_words_are_one_clear_error(text, told):
    with pytest.raises(ConfigError) as caught:
        parse_effect(text, TIAGO)
    message = str(caught.value)
    assert told in message
    assert "\n" not in message


def test_a_set_without_noise_gives_none_and_can_be_read(tmp_path):
    write_set(plain().measured, tmp_path / "set")
    measured = read_set(tmp_path / "set")
    assert (measured.position_std_m, measured.force_std_n) == (None, None)
    assert check_set(measured, TIAGO.stroke) == []
