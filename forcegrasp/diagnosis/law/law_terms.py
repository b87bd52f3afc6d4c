"""The terms of which a law for the unknown may be made, and what they come to along measured grasps."""

from __future__ import annotations

import ast
import itertools
import re
from collections.abc import Iterator

import numpy as np

from forcegrasp.effects.each_finger import SIDES
from forcegrasp.effects.for_gripper import effects_of
from forcegrasp.effects.law import Formula, Law, Size, has_sides, make_law
from forcegrasp.effects.motor_offset import MotorOffset
from forcegrasp.errors import ConfigError
from forcegrasp.identify.comparison import of_width
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.target import Target

# {e} is what drives the motor: command − position, or the effort that is commanded. {v} is a slow speed. {side} is by
# how much the phases of two fingers' waves are apart, if there are two.
# Units: L of a position, T of time, F of a force, E of {e}.
_WAVE = ("sin(6.28319 * position / period + phase{side})", "")
# Neither a line nor a square alone comes near a curve whose turning point is on the way.
_CURVE = ("position * (position - centre)", "L²")
_MOTOR = (
    ("1", ""), ("position", "L"), ("position**2", "L²"), _CURVE,
    ("velocity", "L/T"), ("abs(velocity) * velocity", "L²/T²"), ("velocity**2", "L²/T²"), ("tanh(velocity / {v})", ""),
    ("position * velocity", "L²/T"), ("position**2 * velocity", "L³/T"), ("force * velocity", "F·L/T"),
    ("sign(force) * velocity", "L/T"), ("{e} * velocity", "E·L/T"),
    ("force", "F"), ("force**2", "F²"), ("sign(force)", ""), ("position * force", "L·F"),
    ("time_since_contact", "T"), ("time", "T"), ("memory(force, tau)", "F"),
    ("abs({e})", "E"), ("{e} * abs({e})", "E²"), ("{e} * position", "E·L"), ("{e} * memory(abs({e}), tau)", "E²"),
    ("sign(force) * {e}", "E"), ("memory(velocity, tau)", "L/T"),
    ("velocity * exp(-((position - centre) / width)**2)", "L/T"),
    _WAVE,
)  # fmt: skip
_FORCE = (
    ("sign(force)", ""), ("force * abs(force)", "F²"), ("force**3", "F³"), ("force * position", "F·L"),
    ("force * time", "F·T"), ("force * velocity", "F·L/T"), ("memory(force, tau)", "F"), ("position", "L"),
    ("position**2", "L²"), _CURVE, ("velocity", "L/T"), ("abs(velocity) * velocity", "L²/T²"), ("acceleration", "L/T²"),
    ("time", "T"), ("time**2", "T²"),
)  # fmt: skip
_POSITION = (
    ("position", "L"), ("position**2", "L²"), _CURVE, ("position**3", "L³"), ("velocity", "L/T"), ("force", "F"),
    ("force * abs(force)", "F²"), ("sign(force)", ""), ("force * position", "F·L"), ("memory(force, tau)", "F"),
    ("time", "T"), ("time**2", "T²"), ("time_since_contact", "T"),
    _WAVE,
)  # fmt: skip
#: Terms by the place where they act. A shift of a commanded position is a force on the motor, but for its limits.
LIBRARY = {"motor": _MOTOR, "force": _FORCE, "position": _POSITION}
# Numbers inside terms: those that are tried, and between what a fit may choose. Time constants, s; of a place on the
# way of a motor, the shares of that way at which it may be, and how wide it is; phases of a wave, rad.
_LAGS, _SHORTEST, _LONGEST = (0.1, 0.5, 2.0), 0.02, 10.0
_PLACES, _WIDTHS, _NARROWEST = (0.1, 0.25, 0.4, 0.55, 0.7, 0.85), (0.12,), 0.02
_PHASES, _APART, _ROUND = (0.0, 1.5708), (0.0, 0.7854, -0.7854, 1.5708), 6.28319
# Waves on the way of a motor, their shortest period as a share of it, and how many of the likeliest are tried; what is
# smooth along the way, a polynomial of so many coefficients, is none.
_SLOWEST_WAVE, _WAVE_STEP, _PERIOD, _MOST_PERIODS, _SMOOTH = 0.75, 0.2, 1 / 40, 2, 3
# A term of a reading is tried so large that it is so many times the noise; and between what a fit stays. Its size is
# that of its largest values: a feedback must not run away.
_READING, _RANGE, _NEARLY_LARGEST = 3.0, 50.0, 0.98
#: Numbers inside terms by name, and those of them that are tried.
_Inside = dict[str, tuple[Size, tuple[float, ...]]]
# Of a fast motion's speed what is slow.
_SLOW = 0.1


def terms(fit: Fit, target: Target) -> Iterator[type[Law]]:
    """Every term that a gripper can have, with a coefficient with which it is small along the grasps of a fit."""
    gripper = target.gripper
    drive = "command - position" if gripper.command == "position" else "command"
    driven = gripper.unit if gripper.command == "position" else gripper.effort_unit
    speeds = np.abs(sampled("position", fit, target)["velocity"])
    slow = float(f"{max(_SLOW * np.nanquantile(speeds[target.mask], 0.9), 1e-9):.1g}")
    units: dict[str, str] = {"L": gripper.unit, "T": "s", "F": target.axis.units[-1], "E": driven}
    offset = effects_of(gripper).get(MotorOffset.name, MotorOffset).parameters[0]
    noise, inner = float(target.sigma[target.axis.forces].max(initial=0.0)), _inner(fit, target)
    amounts = {
        "motor": (offset.typical, offset.unit),
        "position": (_READING * float(target.sigma[target.axis.positions].max()), gripper.unit),
        "force": (_READING * noise, units["F"]),
    }
    for place, library in LIBRARY.items():
        amount, unit = amounts[place]
        apart = " + apart * side" if has_sides(place, gripper) else ""
        for text, of_term in library:
            term = text.format(e=f"({drive})", v=slow, side=apart)
            expression = ast.unparse(ast.parse("c1" if text == "1" else f"c1 * {term}"))  # without spare parentheses
            per = of_term.translate(str.maketrans(units))
            divided = f"({per})" if "·" in per or "/" in per else per
            law = _scaled(place, expression, amount, f"{unit}/{divided}" if per else unit, inner, fit, target)
            if law is not None:
                yield law


def _scaled(
    place: str, expression: str, amount: float, unit: str, inside: _Inside, fit: Fit, target: Target
) -> type[Law] | None:
    """A term that adds this amount where it is large; None if it does nothing here, or can't be on this gripper."""
    inner = {n: size for n, size in inside.items() if re.search(rf"\b{n}\b", expression)}

    def make(size: float) -> type[Law]:
        most = float(f"{_RANGE * abs(size):.6g}")
        sizes = {"c1": Size(value=size, low=-most, high=most, unit=unit)}
        sizes |= {name: numbers for name, (numbers, _) in inner.items()}
        formula = Formula(place=place, expression=expression, parameters=sizes)  # pyright: ignore[reportArgumentType]
        law = make_law(f"{place} {expression}", formula, target.gripper)
        tried = np.array(list(itertools.product([size], *(trials for _, trials in inner.values()))))
        return type(law.__name__, (law,), {"trials": classmethod(lambda cls: tried.copy())})

    try:
        added = along(make(1.0), None, fit, target)[target.mask]
    except ConfigError:
        return None
    size = float(np.quantile(np.abs(added), _NEARLY_LARGEST))
    if not (np.isfinite(size) and size > 0 < amount):
        return None
    brakes = place == "motor" and "velocity" in expression  # what drives a motion on runs away
    return make((-1 if brakes else 1) * float(f"{amount / size:.2g}"))


def _inner(fit: Fit, target: Target) -> _Inside:
    """Numbers inside terms by name, and those of them that are tried."""
    position, unit = fit.predicted[..., target.axis.positions][target.mask], target.gripper.unit
    low, high = (float(f"{end:.3g}") for end in np.quantile(position, (0.0, 1.0)))
    way = max(high - low, 1e-9)
    places, widths = (tuple(float(f"{x:.2g}") for x in some) for some in (
        [low + share * way for share in _PLACES], [share * way for share in _WIDTHS]
    ))  # fmt: skip
    periods = tuple(float(f"{period:.4g}") for period in likely_periods(fit, target))
    return {
        "period": (Size(value=periods[0], low=_PERIOD / 2 * way, high=2 * way, unit=unit), periods),
        "phase": (Size(value=_PHASES[0], low=-_ROUND, high=_ROUND, unit="rad"), _PHASES),
        "apart": (Size(value=_APART[0], low=-_ROUND, high=_ROUND, unit="rad"), _APART),
        "tau": (Size(value=_LAGS[1], low=_SHORTEST, high=_LONGEST, unit="s"), _LAGS),
        "centre": (Size(value=places[2], low=low - way, high=high + way, unit=unit), places),
        "width": (Size(value=widths[0], low=_NARROWEST * way, high=way, unit=unit), widths),
    }


def likely_periods(fit: Fit, target: Target) -> list[float]:
    """Periods along the way of the motors of what is left of their positions, m or rad, the likeliest first.

    Cogging and ripple of gears or of an encoder have one that a fit finds from nearby alone. A servo that lags shifts
    waves, and does not stretch them.
    """
    position, left = (each[..., target.axis.positions][target.mask] for each in (fit.predicted, fit.residual))
    way = max(float(np.ptp(position)), 1e-9)
    waves = np.arange(_SLOWEST_WAVE, 1 / _PERIOD, _WAVE_STEP)  # on the way
    explained = np.zeros(len(waves))
    for where, residual in zip(position.T / way, left.T, strict=True):
        read = np.isfinite(residual)
        smooth, _ = np.linalg.qr(np.vander(where[read], _SMOOTH))
        rest = residual[read] - smooth @ (smooth.T @ residual[read])
        for index, number in enumerate(waves):
            angle = _ROUND * number * where[read]
            wave = np.column_stack([np.sin(angle), np.cos(angle)])
            wave -= smooth @ (smooth.T @ wave)
            explained[index] += rest @ wave @ np.linalg.lstsq(wave, rest, rcond=1e-9)[0]
    around = np.pad(explained, 1)
    peaks = np.flatnonzero((explained >= around[:-2]) & (explained >= around[2:]))
    best = peaks[np.argsort(-explained[peaks])][:_MOST_PERIODS]
    return (way / waves[best]).tolist()


def along(law: type[Law], values: np.ndarray | None, fit: Fit, target: Target) -> np.ndarray:
    """What a law adds at the samples of a fit's predictions, ``(G, S, motors or channels)``.

    Args:
      law: the law.
      values: of its parameters, ``(parameters,)``; those of its file by default.
      fit: whose predictions are taken for what the gripper did.
      target: the measurements.
    """
    sizes = [one.value for one in law.formula_of.parameters.values()] if values is None else values
    parameters = {p.name: np.full((1, 1), float(value)) for p, value in zip(law.parameters, sizes, strict=True)}
    signals = sampled(law.formula_of.place, fit, target)
    width = signals["time_since_contact"].shape[-1]
    state = law.parsed.memory(len(target.grasps), width)
    step = float(np.median(np.concatenate([np.diff(grasp.time_s) for grasp in target.grasps])))
    found = np.empty((*target.mask.shape, width))
    for sample in range(target.mask.shape[1]):
        now = {name: values[:, sample] for name, values in signals.items()}
        found[:, sample] = law.parsed.value(now, parameters, state, step)
    return found


def sampled(place: str, fit: Fit, target: Target) -> dict[str, np.ndarray]:
    """The signals of a law at the samples, each ``(G, S, motors or channels)``; constant after a grasp's end."""
    position, force = (fit.predicted[..., part].copy() for part in (target.axis.positions, target.axis.forces))
    width = force.shape[-1] if place == "force" else position.shape[-1]
    time, command = np.zeros(target.mask.shape), np.zeros(position.shape)
    velocity, acceleration = np.zeros(position.shape), np.zeros(position.shape)
    for index, grasp in enumerate(target.grasps):
        n = len(grasp.time_s)
        time[index, :n] = grasp.time_s - grasp.time_s[0]
        time[index, n:], position[index, n:], force[index, n:] = time[index, n - 1], position[index, n - 1], 0.0
        command[index, :n], command[index, n:] = grasp.command_m, grasp.command_m[-1]
        if n > 1:
            velocity[index, :n] = np.gradient(position[index, :n], time[index, :n], axis=0)
            acceleration[index, :n] = np.gradient(velocity[index, :n], time[index, :n], axis=0)
    force = of_width(force, width) if force.shape[-1] else np.zeros((*target.mask.shape, width))
    noise = target.sigma[target.axis.forces].max(initial=0.0)
    touched = np.maximum.accumulate(np.abs(force) > noise, axis=1)
    first = np.take_along_axis(time[..., None], np.argmax(touched, axis=1)[:, None], axis=1)
    since = np.where(touched, time[..., None] - first, 0.0)
    return {
        "position": of_width(position, width), "velocity": of_width(velocity, width), "force": force,
        "acceleration": of_width(acceleration, width), "command": of_width(command, width),
        "time": np.repeat(time[..., None], width, axis=-1), "time_since_contact": since,
        "side": np.broadcast_to(SIDES if has_sides(place, target.gripper) else 0.0, (*target.mask.shape, width)),
    }  # fmt: skip
