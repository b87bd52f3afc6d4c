"""Effects in a plant: each on its own rows, where it acts, in the order of their stages."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from forcegrasp.physics.protocols import Contribution, PlantEffect
from forcegrasp.physics.sensors import ReadingEffects


class AttachedEffects:
    """Effects that are attached to one plant of ``n`` rows.

    Args:
      effects: in the order in which they act.
    """

    def __init__(self, effects: Sequence[PlantEffect]) -> None:
        self._effects = tuple(effects)
        self._command, self._range, self._act, self._interaction, self._motor_position = (
            [effect for effect in effects if hook in effect.hooks()]
            for hook in ("command", "motor_range", "act", "interaction", "motor_position")
        )
        self._of_commands = [effect for effect in self._command if effect.is_known_beforehand]
        self._of_motion = [effect for effect in self._act if effect.follows_motion]
        #: Names of what :meth:`contribute` may have set to something else than 0 in its last call.
        self.given = set(Contribution._fields)
        self.readings = ReadingEffects(effects)
        #: Whether any acts by what happens in a step, and not only by the model, by commands, or alike in every step.
        self.act_in_steps = any(
            effect.hooks() - ({"change_model", "act"} if effect.acts_alike else {"change_model"})
            and not effect.is_known_beforehand
            for effect in effects
        )

    def __len__(self) -> int:
        return len(self._effects)

    def __iter__(self) -> Iterator[PlantEffect]:
        return iter(self._effects)

    def change_model(self, plant: Any, ids: np.ndarray) -> None:
        """Lets them change the model in these rows of the plant."""
        for effect, which in self._rows_of(ids):
            effect.change_model(plant, which)

    def reset(self, ids: np.ndarray) -> None:
        """Gives them the memory of a new grasp in these rows of the plant, where it stands at its start."""
        for effect, which in self._rows_of(ids):
            effect.reset(which)

    @contextlib.contextmanager
    def kept(self, ids: np.ndarray) -> Generator[None]:
        """Keeps their memory in these rows of the plant, whatever is read meanwhile."""
        before = [
            (effect, which, {name: values[which] for name, values in effect.state.items()})
            for effect, which in self._rows_of(ids)
        ]
        yield
        for effect, which, memory in before:
            for name, values in memory.items():
                effect.state[name][which] = values

    @property
    def change_commands(self) -> bool:
        """Whether any changes commands on their way to the motors."""
        return bool(self._command)

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        """Commanded positions ``(n, motors)`` on their way to the motors; which are new ones: ``fresh`` ``(n,)``."""
        command = np.array(command, float)
        for effect in self._command:
            command[effect.at] = effect.command(command[effect.at].copy(), fresh[effect.at])
        return command

    def commands(self, commands: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        """The same for the commands of many steps ``(n, steps, motors)``, where nothing else acts in them."""
        commands, fresh = np.array(commands.swapaxes(0, 1), order="C"), fresh.T
        for effect in self._command:
            commands[:, effect.at] = effect.commands(commands[:, effect.at].copy(), fresh[:, effect.at])
        return commands.swapaxes(0, 1)

    @property
    def remember(self) -> bool:
        """Whether any has a memory of commands alone, or of motion alone."""
        return bool(self._of_commands or self._of_motion)

    def forget(self) -> None:
        """Starts the memory of those that :meth:`recall` anew, where the plant's motors are said to be."""
        for effect in {*self._of_commands, *self._of_motion}:
            effect.reset(np.arange(len(effect.rows)))

    def recall(self, command: np.ndarray, fresh: np.ndarray) -> None:
        """Lets those of a memory of commands alone, or of motion, see a step before the start, as :meth:`command`.

        The plant's motors are where they were.
        """
        command = np.array(command, float)
        for effect in self._of_commands:
            command[effect.rows] = effect.command(command[effect.rows], fresh[effect.rows])
        for effect in self._of_motion:
            effect.act()

    @property
    def limit_motors(self) -> bool:
        """Whether any limits what the motors can give from step to step."""
        return bool(self._range)

    def motor_range(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest force of the motors in this step, ``(n, motors)``; positive opens."""
        low, high = low.copy(), high.copy()
        for effect in self._range:
            low[effect.rows], high[effect.rows] = effect.motor_range(low[effect.rows], high[effect.rows])
        return low, high

    def contribute(self, totals: Mapping[str, np.ndarray]) -> bool:
        """Sums up what they contribute to a step; returns whether any may.

        Args:
          totals: set to the sums, of all rows, by the names and in the order of
            :class:`~forcegrasp.physics.protocols.Contribution`. An effect finds those of the ones before it.
        """
        if not self._act:
            return False
        for name in self.given:
            totals[name].fill(0)
        self.given.clear()
        for effect in self._act:
            for (name, total), added in zip(totals.items(), effect.act(), strict=True):
                if added is not None:
                    total[effect.at] += added
                    self.given.add(name)
        return True

    def interaction(self, force: np.ndarray) -> np.ndarray:
        """True forces between pads and object, newtons, ``(n, 2)``, from those of the contacts."""
        return _in_turn(self._interaction, lambda effect, values: effect.interaction(values), force)

    def motor_position(self, joints: np.ndarray) -> np.ndarray:
        """Positions of the motors, m or rad, ``(n, motors)``, from those of their joints."""
        return _in_turn(self._motor_position, lambda effect, values: effect.motor_position(values), joints)

    def _rows_of(self, ids: np.ndarray) -> list[tuple[PlantEffect, np.ndarray]]:
        """Each effect with those of its own rows that are among these of the plant."""
        return [(effect, np.flatnonzero(np.isin(effect.rows, ids))) for effect in self._effects]


def _in_turn(
    effects: Sequence[PlantEffect], hook: Callable[[PlantEffect, np.ndarray], np.ndarray], values: np.ndarray
) -> np.ndarray:
    """Values of all rows after each effect made others of those of its own; the very array if there is none."""
    if not effects:
        return values
    values = values.copy()
    for effect in effects:
        values[effect.at] = hook(effect, values[effect.at].copy())
    return values
