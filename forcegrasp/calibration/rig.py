"""What every calibration does: close with a constant delta, and record positions and forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from forcegrasp.errors import ConfigError, PhysicsError, closest
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import default_gripper
from forcegrasp.physics.gripper_parts import BaseParameter
from forcegrasp.physics.plant import Plant, write_base

#: Largest position delta, Δq_max, of the paper's gripper, metres (paper, appendix).
MAX_DELTA_M = default_gripper().max_step
#: Seconds between two samples.
SAMPLE_S = 0.004
#: Seconds at the end over which a final value is averaged.
FINAL_S = 0.4
# Seconds at rest before the first command, in which the object sinks into the floor as deep as it will.
_REST_S = 0.6
_NO_CONTACT = int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
# Simulated seconds, over all closings: their samples take 8 kB per second.
_MOST_S = 50_000.0

#: What a parameter may be given as: one value for all simulations, or one for each.
Values = float | Sequence[float] | np.ndarray


@dataclass(frozen=True)
class Closing:
    """n closings of both fingers; time 0 is the first command."""

    time_s: np.ndarray  #: ``(T,)``
    position_m: np.ndarray  #: left, right; 0 is closed, ``(n, T, 2)``
    force_n: np.ndarray  #: left, right, ``(n, T, 2)``

    @property
    def final_force_n(self) -> np.ndarray:
        """f(T): mean of both fingers over the last 0.4 s, newtons, ``(n,)``.

        Of both, because the readings hold tangential forces whose signs differ: one finger alone is up to 3 % off.
        """
        return self._late(self.force_n)

    @property
    def final_position_m(self) -> np.ndarray:
        """q(T): mean of both fingers over the last 0.4 s, metres, ``(n,)``."""
        return self._late(self.position_m)

    def _late(self, signal: np.ndarray) -> np.ndarray:
        return signal[:, self.time_s > self.time_s[-1] - FINAL_S].mean(axis=(1, 2))


def close(
    delta_m: Values,
    seconds: float,
    values: Mapping[str, Values] | None = None,
    *,
    gripper: Gripper | None = None,
    touching: bool = True,
    start_m: Values | None = None,
    tier: str = "reference",
    period_s: float | None = None,
    threads: int = 0,
) -> Closing:
    """Commands q_des = q − Δq to both fingers again and again, in many simulations at once (paper, eq. 4).

    Args:
      delta_m: Δq, metres, positive closes; ``(n,)`` or one for all.
      seconds: how long.
      values: base parameters by their names in the gripper's description, each ``(n,)`` or one for all; what is not
        named keeps the scene's value.
      gripper: the paper's by default.
      touching: whether there is anything to touch; without, fingers close until they stop.
      start_m: where the fingers start, metres, ``(n,)`` or one for all; open by default.
      tier: physics tier, ``"reference"`` or ``"fast"``.
      period_s: seconds for which each command is held, to the nearest physics step; the gripper's by default.
      threads: threads of the engine; 0 uses every core that this process may use.

    Raises:
      ConfigError: if a parameter is unknown, a value is none that can be simulated, or lengths differ.
      PhysicsError: if a simulation diverged.
    """
    gripper = gripper or default_gripper()
    given = {"delta_m": delta_m, **(values or {})} | ({} if start_m is None else {"start_m": start_m})
    columns = _columns(gripper, given)
    delta = columns.pop("delta_m")
    n = len(delta)
    period_s = gripper.period_s if period_s is None else period_s
    for name, value, low, high in (("period_s", period_s, 0.001, 1.0), ("seconds", seconds, FINAL_S, _MOST_S / n)):
        if not low <= value <= high:
            raise ConfigError(f"{name}={value:g}: must lie in [{low:g}, {high:g}]")
    start = columns.pop("start_m", np.full(n, gripper.stroke))
    plant = Plant(gripper, n, tier, threads)
    if not touching:
        plant.base("opt.disableflags")[:] |= _NO_CONTACT
    plant.reset(np.arange(n), write_base(plant, np.arange(n), columns), np.repeat(start[:, None], 2, axis=1))
    plant.advance(np.repeat(start[:, None], 2, axis=1), round(_REST_S / plant.dt))
    return _record(plant, delta, seconds, period_s)


def _record(plant: Plant, delta: np.ndarray, seconds: float, period_s: float) -> Closing:
    steps, stride = max(1, round(period_s / plant.dt)), max(1, round(SAMPLE_S / plant.dt))
    position, force, time = [plant.measured_position], [plant.measured_force], [0.0]
    command = plant.measured_position
    for step in range(max(1, round(seconds / plant.dt))):
        if step % steps == 0:
            command = np.clip(plant.measured_position - delta[:, None], 0.0, plant.gripper.stroke)
        plant.advance(command)
        if (step + 1) % stride == 0:
            position.append(plant.measured_position)
            force.append(plant.measured_force)
            time.append((step + 1) * plant.dt)
    if plant.warnings().any():
        worst = int(np.flatnonzero(plant.warnings().any(axis=1))[0])
        raise PhysicsError(
            f"closing {worst} diverged: keep its parameters nearer to the scene's, or take smaller steps"
        )
    return Closing(np.array(time), np.stack(position, axis=1), np.stack(force, axis=1))


def _columns(gripper: Gripper, given: Mapping[str, Values]) -> dict[str, np.ndarray]:
    """Each value as a column of n, checked."""
    columns = {name: column_of(name, value) for name, value in given.items()}
    lengths = {len(column) for column in columns.values()} - {1}
    if len(lengths) > 1:
        counts = ", ".join(f"{name} {len(column)}" for name, column in columns.items() if len(column) > 1)
        raise ConfigError(f"one value each, or as many as there are closings: got {counts}")
    n = max(lengths, default=1)
    for name, column in columns.items():
        low, high = _bounds(gripper, name)
        if not ((column >= low) & (column <= high)).all():
            wrong = column[(column < low) | (column > high)][0]
            raise ConfigError(f"{name}={wrong:g}: must lie in [{low:g}, {high:g}]")
    return {name: np.broadcast_to(column, n).copy() for name, column in columns.items()}


def _bounds(gripper: Gripper, name: str) -> tuple[float, float]:
    if name in ("delta_m", "start_m"):
        return 1e-6 if name == "delta_m" else 0.0, gripper.stroke
    parameter = parameter_of(gripper, name)
    return parameter.low, parameter.high


def parameter_of(gripper: Gripper, name: str) -> BaseParameter:
    """A base parameter of a gripper.

    Raises:
      ConfigError: if its description has none of this name.
    """
    if name not in gripper.parameters:
        raise ConfigError(f"{name}: {gripper.name} has no such parameter{closest(name, gripper.parameters)}")
    return gripper.parameters[name]


def column_of(name: str, value: Values) -> np.ndarray:
    """Finite numbers as a float64 column, ``(n,)``.

    Raises:
      ConfigError: if they are none.
    """
    try:
        column = np.atleast_1d(np.asarray(value, float))
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{name}: must be a number, or one for each closing") from error
    if column.ndim != 1 or not len(column) or not np.isfinite(column).all():
        raise ConfigError(f"{name}: must be a finite number, or one for each closing")
    return column
