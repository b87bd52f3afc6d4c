"""Legitimate sets, however odd: the effects that the diagnosis is there to find, and real logs, pass every check."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from measured_rig import OPEN_M, change, closing, cycles, make_grasp, make_set, standard_grasps

from forcegrasp.errors import MeasurementError
from forcegrasp.measure import check_set
from forcegrasp.measure.check_liveness import feels
from forcegrasp.measure.check_signs import _check_follows, _check_free_air


def _force(change_force):
    """A change of the forces: function of force ``(T, 2)``, time ``(T,)`` and the grasp's number."""

    def vary(grasps):
        return [change(g, force_n=change_force(g.force_n, g.time_s[:, None], i)) for i, g in enumerate(grasps)]

    return vary


def _position(change_position):
    return lambda grasps: [change(g, position_m=change_position(g.position_m, g)) for g in grasps]


def _delayed(values: np.ndarray, time: np.ndarray, by: float) -> np.ndarray:
    return values[np.maximum(np.searchsorted(time, time - by, side="right") - 1, 0)]


def _lagging(values: np.ndarray, dt: float, tau: float) -> np.ndarray:
    out = values.copy()
    for i in range(1, len(values)):
        out[i] = out[i - 1] + dt / (tau + dt) * (values[i] - out[i - 1])
    return out


def _play(values: np.ndarray, width: float) -> np.ndarray:
    out = values.copy()
    for i in range(1, len(values)):
        out[i] = np.clip(out[i - 1], values[i] - width / 2, values[i] + width / 2)
    return out


def _jitter(grasps):
    draw = np.random.default_rng(1)
    return [change(g, time_s=g.time_s + draw.uniform(-0.015, 0.015, len(g.time_s))) for g in grasps]


def _without(grasps, keep):
    out = []
    for g in grasps:
        rows = keep(g)
        arrays = {k: getattr(g, k)[rows] for k in ("time_s", "command_m", "position_m", "force_n", "object_m")}
        out.append(change(g, **arrays))
    return out


def _adhesion(force, time, _):
    falling = np.gradient(force, axis=0) < -0.02 * force.max()
    return np.where(falling & (force < 0.2 * force.max()), -0.15 * force.max(), force)


ON_READINGS = {
    "as it is": lambda grasps: grasps,
    "bias of 0.3 N": _force(lambda f, t, i: f + 0.3),
    "bias of -2 N, twice the force": _force(lambda f, t, i: f - 2),
    "bias on one finger": _force(lambda f, t, i: f - np.array([0.0, 1.0])),
    "bias anew in each grasp": _force(lambda f, t, i: f + 0.5 * (i - 2)),
    "drift up": _force(lambda f, t, i: f + 0.1 * t),
    "drift down": _force(lambda f, t, i: f - 0.3 * t),
    "strong drift down": _force(lambda f, t, i: f - 0.8 * t),
    "drift apart": _force(lambda f, t, i: f + [0.1, -0.1] * t),
    "drift and bias": _force(lambda f, t, i: f - 1 + 0.2 * t),
    "force delay of 100 ms": lambda g: [change(x, force_n=_delayed(x.force_n, x.time_s, 0.1)) for x in g],
    "force delay of 400 ms": lambda g: [change(x, force_n=_delayed(x.force_n, x.time_s, 0.4)) for x in g],
    "force lag of 200 ms": _force(lambda f, t, i: _lagging(f, 0.04, 0.2)),
    "dead zone of 0.3 N": _force(lambda f, t, i: np.maximum(f - 0.3, 0)),
    "dead zone of 1 N, right": _force(lambda f, t, i: np.maximum(f - [0.05, 1.0], 0)),
    "saturation at 0.5 N": _force(lambda f, t, i: np.minimum(f, 0.5)),
    "saturation at 0.5 N, left": _force(lambda f, t, i: np.minimum(f, [0.5, 9])),
    "right finger at 10 %": _force(lambda f, t, i: f * [1, 0.1]),
    "right finger at 1 %": _force(lambda f, t, i: f * [1, 0.01]),
    "forces of 30 mN": _force(lambda f, t, i: f / 100 + 0.0005),
    "crosstalk": _force(lambda f, t, i: f + 0.2 * f[:, ::-1]),
    "negative crosstalk": _force(lambda f, t, i: f - 0.3 * f[:, ::-1]),
    "adhesion": _force(_adhesion),
    "quantised to 50 mN": _force(lambda f, t, i: 0.05 * np.round(f / 0.05)),
    "quantised to 0.5 N": _force(lambda f, t, i: 0.5 * np.round(f / 0.5)),
    "no force noise": _force(lambda f, t, i: np.round(f, 1) * (f > 0.06)),
    "force decays while held": _force(lambda f, t, i: f * (0.5 + 0.5 * np.exp(-np.maximum(t - 1.5, 0)))),
    "a spike of 20 N": _force(lambda f, t, i: f + 20.0 * (np.arange(len(t))[:, None] == 5)),
    "spikes": _force(lambda f, t, i: f - 9.0 * (np.arange(len(t))[:, None] % 60 == 7)),
    "friction of a motor seen as force": _force(lambda f, t, i: f + 0.2 * (t > 0.4)),
    "noise three times as given": _force(lambda f, t, i: f + np.random.default_rng(i).normal(0, 0.04, f.shape)),
    "right sensor off": _force(lambda f, t, i: f * [1, 0]),
    "right sensor noisy and deaf": _force(lambda f, t, i: np.where([True, False], f, f - f + 0.01 * np.sin(99 * t))),
    "encoder bias of 1 mm": _position(lambda q, g: q + 0.001),
    "encoder bias of one finger": _position(lambda q, g: q - np.array([0.0, 0.0015])),
    "beyond the stops by 2 mm": _position(lambda q, g: q + 0.002),
    "quantised positions": _position(lambda q, g: 0.0005 * np.round(q / 0.0005)),
    "backlash of 1 mm": _position(lambda q, g: _play(q, 0.001)),
    "delay of 100 ms": _position(lambda q, g: _delayed(q, g.time_s, 0.1)),
    "delay of 300 ms": _position(lambda q, g: _delayed(q, g.time_s, 0.3)),
    "unix time": lambda grasps: [change(g, time_s=g.time_s + 1.7e9 + 100 * i) for i, g in enumerate(grasps)],
    "negative times": lambda grasps: [change(g, time_s=g.time_s - 1000) for g in grasps],
    "jitter": _jitter,
    "lost samples": lambda grasps: _without(grasps, lambda g: np.arange(len(g.time_s)) % 7 != 3),
    "other lengths": lambda grasps: _without(grasps, lambda g: np.arange(len(g.time_s)) < 99 - 5 * int(g.name[1])),
    "starts in contact": lambda grasps: _without(grasps, lambda g: g.time_s > 1.6),
    "two grasps": lambda grasps: grasps[:2],
    "many sessions": lambda grasps: [change(g, session=g.name) for g in grasps],
    "no object position": lambda grasps: [change(g, object_m=None) for g in grasps],
    "radius not given": lambda grasps: [change(g, radius_m=None) for g in grasps],
    "offset not given": lambda grasps: [change(g, offset_m=None) for g in grasps],
    "neither given": lambda grasps: [change(g, offset_m=None, radius_m=None) for g in grasps],
    "radius wrong by a half": lambda grasps: [change(g, radius_m=1.5 * g.radius_m) for g in grasps],
    "one free motion": lambda grasps: [
        *grasps,
        change(grasps[0], name="free", force_n=0.01 * np.sin(grasps[0].force_n)),
    ],
    "one offset of wrong sign": lambda grasps: [*grasps[:5], change(grasps[5], offset_m=0.012)],
}


@pytest.mark.parametrize("case", ON_READINGS)
@pytest.mark.parametrize("command", [closing, cycles], ids=["close and hold", "cycles"])
@pytest.mark.parametrize("noise", [True, False], ids=["σ given", "σ unknown"])
def test_readings(made, case, command, noise):
    grasps = ON_READINGS[case](made[command])
    known = {} if noise else {"position_std_m": None, "force_std_n": None}
    for warning in check_set(make_set(grasps, **known), OPEN_M):
        assert warning.isprintable()


@pytest.fixture(scope="module")
def made():
    return {command: standard_grasps(command=command) for command in (closing, cycles)}


def _steps(time):
    return np.where(time < 0.5, OPEN_M, 0.018)


def _small_steps(time):
    return 0.024 - 0.001 * np.floor(np.maximum(time - 0.5, 0) / 0.5)


def _one_finger(time):
    return np.stack([closing(time), np.full(len(time), OPEN_M)], axis=1)


def _left_first(time):
    return np.stack([closing(time, start_s=0.1), closing(time, start_s=1.0)], axis=1)


def _push_to_the_right(time):
    return np.stack([closing(time, 0.012, 0.2, 0.03), 0.02 + 0.008 * np.clip(time - 1, 0, 1.5)], axis=1)


def _through_closed(time):
    return closing(time, target=-0.05, speed=0.03)


def _hold(time):
    return np.r_[OPEN_M, np.full(len(time) - 1, 0.02)]


COMMANDS = {
    "step": ({"command": _steps}, 0.0),
    "small steps near the object": ({"command": _small_steps}, 0.0),
    "left finger only": ({"command": _one_finger}, 0.0),
    "left finger only, off-centre": ({"command": _one_finger}, -0.005),
    "left finger first": ({"command": _left_first}, 0.0),
    "left finger first, object to the right": ({"command": _left_first}, 0.006),
    "pushed into the right finger, which yields": ({"command": _push_to_the_right}, 0.0),
    "far beyond closed": ({"command": _through_closed, "stiffness": 5000.0}, 0.0),
    "slow ramp": ({"command": lambda t: closing(t, speed=0.003), "seconds": 12.0}, 0.0),
    "fast": ({"command": lambda t: closing(t, speed=0.3)}, 0.01),
    "10 Hz": ({"rate": 10.0}, 0.01),
    "50 Hz": ({"rate": 50.0}, 0.01),
    "100 Hz": ({"rate": 100.0}, -0.01),
    "500 Hz": ({"rate": 500.0}, 0.01),
    "slow servo": ({"lag_s": 0.5}, 0.0),
    "slippery object": ({"friction": 0.01}, 0.01),
    "fixed object": ({"friction": 1e6}, 0.01),
    "soft object": ({"stiffness": 20.0}, 0.0),
    "hard object": ({"stiffness": 5000.0}, 0.0),
    "large object": ({"radius": 0.04}, 0.0),
    "small object": ({"radius": 0.017}, 0.0),
    "half a second": ({"seconds": 0.5, "command": lambda t: closing(t, start_s=0.0, speed=0.2)}, 0.0),
    "step given at the start": ({"command": _hold}, 0.0),
}


@pytest.mark.parametrize("case", COMMANDS)
def test_command(case):
    options, offset = COMMANDS[case]
    grasps = [make_grasp(i, **({"radius": 0.025, "offset": offset} | options)) for i in range(4)]
    check_set(make_set(grasps), OPEN_M)


def test_command_given_before_the_first_sample():
    grasps = [
        change(g, command_m=np.full_like(g.command_m, 0.015)) for g in (make_grasp(i, command=_hold) for i in (0, 1))
    ]
    assert any("no command changes" in warning for warning in check_set(make_set(grasps), OPEN_M))


@pytest.mark.parametrize(("scale", "open_m"), [(2.0, 0.09), (0.1, 0.0045), (10, 0.45)])
def test_other_grippers(grasps, scale, open_m):
    lengths = ("command_m", "position_m", "object_m", "radius_m", "offset_m")
    other = [change(g, **{name: scale * getattr(g, name) for name in lengths}) for g in grasps]
    assert check_set(make_set(other, position_std_m=scale * 2.7e-5), open_m) == []


def test_closed_is_not_zero(grasps):
    shifted = [change(g, command_m=g.command_m + 0.1, position_m=g.position_m + 0.1, radius_m=None) for g in grasps]
    assert check_set(make_set(shifted), 0.145, 0.1) == []


def _noise():
    return np.random.default_rng(0).normal(0, 0.013, (100, 2))


def _smooth(grasp):
    """What a simulation without noise reads on both sides."""
    return 200 * np.maximum(grasp.radius_m - grasp.command_m, 0)[:, [0, 0]]


WARNED = {
    "a gap": (lambda g: _without(g, lambda x: (x.time_s < 1) | (x.time_s > 1.5)), "a gap of 0.5"),
    "one grasp": (lambda g: g[:1], "one grasp only"),
    "a copy": (lambda g: [*g, change(g[0], name="again")], "copied"),
    "a large object": (lambda g: [change(g[0], radius_m=0.08), *g[1:]], "does not fit"),
    "a fast clock": (lambda g: [change(x, time_s=x.time_s / 1e6) for x in g], "samples per second"),
    "large forces": (lambda g: [change(x, force_n=1000 * x.force_n) for x in g], "newtons"),
    "a deaf finger": (
        lambda g: [change(x, force_n=x.force_n * [1, 0]) for x in g],
        "f_r_n: the right finger feels nothing",
    ),
    "smooth forces, twice": (
        lambda g: [change(x, force_n=_smooth(x)) for x in g],
        "f_l_n and f_r_n: the same readings in every row; is one a copy?",
    ),
    "coarse forces, twice": (
        lambda g: [change(x, force_n=0.5 * np.round(x.force_n[:, [0, 0]] / 0.5)) for x in g],
        "f_l_n and f_r_n: the same",
    ),
    "a free motion": (lambda g: [*g, change(g[0], name="free", force_n=_noise())], "no contact"),
}


@pytest.mark.parametrize("case", WARNED)
def test_warning(grasps, case):
    vary, words = WARNED[case]
    warnings = check_set(make_set(vary(grasps)), OPEN_M)
    assert any(words in warning for warning in warnings), warnings
    assert all(warning.isprintable() for warning in warnings)


def test_a_touch_as_light_as_the_noise_is_felt_and_noise_alone_is_not():
    force = np.random.default_rng(3).normal(0, 0.013, (500, 2))
    assert feels(force) == [False, False]
    force[200:300, 1] += 2 * 0.013
    assert feels(force) == [False, True]


def test_a_delay_of_half_a_period_is_no_wrong_direction():
    grasp = make_grasp(0)
    command, position = (0.022 + 0.01 * np.sin(2 * np.pi * (grasp.time_s - late) / 0.8) for late in (0.0, 0.4))
    grasp = change(grasp, command_m=np.stack([command] * 2, axis=1), position_m=np.stack([position] * 2, axis=1))
    _check_follows(make_set([grasp]), 0, OPEN_M)


def test_free_air_of_an_object_on_the_right_ends_early_for_the_right_finger():
    grasp = make_grasp(0, radius=0.02, offset=0.01)
    right = np.linspace(OPEN_M, 0.010, len(grasp.time_s))
    force = np.zeros((len(right), 2))
    chatters = (right < 0.03) & (right > 0.018)  # it touches at 30 mm
    force[:, 1] = np.where(chatters, np.sin(np.arange(len(right))), right < 0.018)
    grasp = change(grasp, position_m=np.stack([np.full_like(right, OPEN_M), right], axis=1), force_n=force)
    _check_free_air(make_set([grasp]), grasp, grasp.position_m, OPEN_M)
    with pytest.raises(MeasurementError, match="in free air"):
        _check_free_air(make_set([grasp]), change(grasp, offset_m=-0.01), grasp.position_m, OPEN_M)


def test_checking_changes_nothing(measured):
    before = [replace(g, force_n=g.force_n.copy(), position_m=g.position_m.copy()) for g in measured.grasps]
    check_set(measured, OPEN_M)
    for old, new in zip(before, measured.grasps, strict=True):
        np.testing.assert_array_equal(old.force_n, new.force_n)
        np.testing.assert_array_equal(old.position_m, new.position_m)
