"""What every physical effect has in common: its description, its parameters, and the places where it can act."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from forcegrasp.physics.places import places
from forcegrasp.physics.plant import Plant
from forcegrasp.physics.protocols import Contribution, State

#: Stages in the order in which they act.
STAGES = ("command", "actuator", "transmission", "contact", "object", "sensor")


@dataclass(frozen=True)
class Parameter:
    """A number that sets the size of an effect."""

    name: str
    doc: str
    unit: str
    low: float  #: smallest value that makes sense
    high: float
    typical: float  #: a size worth noticing; `record` uses it
    null: float = 0.0  #: value at which the effect is not there at all; may be infinite
    logarithmic: bool = False  #: fitted by its logarithm
    trials: tuple[float, ...] = ()  #: sizes that a diagnosis tries
    #: What its sizes are proportional to, from gripper to gripper: the motors' "position", "effort" or "damping",
    #: a contact's "force", or its inverse, "compliance", or what yields under an effort, "motor compliance"; empty if
    #: they are alike for all.
    follows: str = ""
    #: Value in model files that were written before the parameter existed; None: files must have it.
    if_missing: float | None = None


@dataclass(frozen=True)
class Nested:
    """A simpler effect that an effect is at certain values of its parameters."""

    effect: str
    at: Mapping[str, float]  #: parameters of the richer effect, and the values at which it is the simpler one
    same: Mapping[str, str]  #: parameters of the richer effect, and what the simpler one calls them


class Effect:
    """One physical effect on some rows (simulated grasps) of a plant. Subclasses override the hooks of their stage.

    Hooks are called once per physics step with the rows of this effect only, and return what replaces their argument.
    Arrays are float64, SI units, one column for each motor (positions, commands), for each force channel (readings), or
    for each side (pads, contact forces): left and right. Forces that press are positive.

    Args:
      values: parameter values, ``(rows, len(parameters))``.
      dt: physics step, seconds.
      variant: which of the class's ``variants``; the first by default.
      largest: the largest parameter values that will be written into ``values`` before a later reset,
        ``(parameters,)``; by default they stay.

    Raises:
      ValueError: if ``values`` has another shape, or there is no such variant.
    """

    name: ClassVar[str]
    stage: ClassVar[str]
    family: ClassVar[str] = "other"  #: what kind of thing it is, in plain words, such as friction or delay
    #: Simpler effects that it is a generalisation of; names of parameters are those of the catalogue.
    contains: ClassVar[tuple[Nested, ...]] = ()
    symptom: ClassVar[str]  #: what a user sees
    formula: ClassVar[str]
    source: ClassVar[str]
    look_alikes: ClassVar[tuple[str, ...]] = ()
    separates: ClassVar[str] = ""  #: what tells it from its look-alikes
    parameters: ClassVar[tuple[Parameter, ...]]
    #: Ways in which the effect is known to occur; a diagnosis tries each under the one name.
    variants: ClassVar[tuple[str, ...]] = ("",)
    #: What a variant needs, if it is "pads", "position loop" where efforts may be commanded, or "stiffness of objects"
    #: where a base parameter gives each object one; see for_gripper.
    variant_needs: ClassVar[Mapping[str, str]] = {}
    #: Position among the effects of the same stage; smaller acts first.
    order: ClassVar[int] = 0
    #: "motor" or "channel" if there is a parameter for each of them, left and right; `alone` stands for these words in
    #: the name of the only one.
    per: ClassVar[str] = ""
    alone: ClassVar[str] = ""
    #: Variants that change commands by what is commanded alone, whatever happens, so that it can be known beforehand.
    known_beforehand: ClassVar[tuple[str, ...]] = ()
    acts_alike: ClassVar[bool] = False  #: what :meth:`act` adds is the same in every step of a grasp
    follows_motion: ClassVar[bool] = False  #: acts by a memory of positions alone, so that measured ones give it
    in_steps: ClassVar[bool] = False  #: as its size grows, what it does stays as it is, jumps, and stays again
    in_valleys: ClassVar[bool] = False  #: as its size grows, what it does changes in small steps, besides smoothly
    after_noise: ClassVar[bool] = False  #: acts on readings with their noise, as rounding does
    of_set: ClassVar[bool] = False  #: not of the gripper: what the measurement set says is wrong
    needs_object: ClassVar[bool] = False  #: shows only where fingers press on something
    needs_ground: ClassVar[bool] = False  #: has no meaning where the object stands on nothing
    needs_rotors: ClassVar[bool] = False  #: has no meaning where motors have no inertia of their own, or move linkages
    needs_load_behind_rotor: ClassVar[bool] = False  #: has no meaning where rotor and load have no inertia each
    needs_parallel_pads: ClassVar[bool] = False  #: would let objects that are free slip out of pads that turn
    instead_of: ClassVar[tuple[str, ...]] = ()  #: effects that mean nothing beside it
    servo_only: ClassVar[bool] = False  #: of drives alone; where fingers grasp, another effect has its part
    needs_position_loop: ClassVar[bool] = False  #: has no meaning where efforts are commanded
    needs_velocity_gain: ClassVar[bool] = False  #: has no meaning where servos do not act on their velocity
    least_size: ClassVar[float] = -np.inf  #: of its first parameter: what comes out smaller is something else
    least_steps: ClassVar[float] = 0.0  #: of its first parameter, a time, fewer physics steps are the integrator's own
    base_parameter: ClassVar[str] = ""  #: one that says the same; where a gripper has it, the effect is left out
    repeats_damping: ClassVar[bool] = False  #: does what a base parameter of damping does, beside which it is left out
    least_channels: ClassVar[int] = 0  #: force readings that the gripper must have for it to make a difference
    least_motors: ClassVar[int] = 1  #: that move fingers of their own
    # of the gripper, see for_gripper
    motors: ClassVar[int] = 2
    channels: ClassVar[int] = 2
    commands_effort: ClassVar[bool] = False

    plant: Plant  #: what it acts on, once attached

    def __init__(self, values: np.ndarray, dt: float, variant: str = "", largest: np.ndarray | None = None) -> None:
        self.values = np.asarray(values, float)
        if self.values.ndim != 2 or self.values.shape[1] != len(self.parameters):
            raise ValueError(f"{self.name} takes values of shape (rows, {len(self.parameters)})")
        self.variant = variant or self.variants[0]
        if self.variant not in self.variants:
            raise ValueError(f"{self.name} has no variant {variant!r}: {', '.join(self.variants)}")
        self.dt = dt
        self.largest = self.values.max(axis=0, initial=0.0)
        if largest is not None:
            self.largest = np.maximum(self.largest, largest)
        self.rows = np.arange(len(self.values))
        self._state: State | None = None
        self._weights: dict[str | float, np.ndarray] = {}

    @property
    def state(self) -> State:
        """Its memory: what :meth:`init` returned at the start of each grasp, as hooks have changed it since."""
        if self._state is None:
            self._state = self.init(np.arange(len(self.values)))
        return self._state

    def __getitem__(self, parameter: str) -> np.ndarray:
        """A parameter as a column ``(rows, 1)``, by the name it has in the class that defines it."""
        index = self.index(parameter)
        return self.values[:, index : index + 1]

    def longest(self, parameter: str) -> float:
        """The largest value that a parameter will have: what it has, unless it is drawn anew at resets."""
        return float(self.largest[self.index(parameter)])

    def lag_weight(self, time_constant: str | float) -> np.ndarray:
        """:func:`first_order_weight` of a parameter, ``(rows, 1)``, or of a number of seconds; kept until a reset."""
        if time_constant not in self._weights:
            tau = self[time_constant] if isinstance(time_constant, str) else time_constant
            self._weights[time_constant] = first_order_weight(self.dt, tau)
        return self._weights[time_constant]

    def attach(self, plant: Plant, rows: np.ndarray) -> Effect:
        """Puts the effect into a plant, on these rows of it."""
        self.plant, self.rows = plant, np.asarray(rows)
        #: the same places, as a slice if they are evenly spaced; what is read by it may be the plant's own array
        self.at = places(self.rows)
        return self

    @property
    def position(self) -> np.ndarray:
        """True positions of the motors, m or rad, ``(rows, motors)``."""
        return self.plant.position[self.at].copy()

    @property
    def resting_command(self) -> np.ndarray:
        """What is commanded where motors rest, ``(rows, motors)``: their positions, or no effort."""
        return np.zeros_like(self.position) if self.commands_effort else self.position

    @property
    def encoder(self) -> np.ndarray:
        """What the gripper's own driver reads as positions, m or rad, ``(rows, motors)``; as recorded, if it was."""
        known = self.plant.recorded_position
        return (self.plant.measured_position if known is None else known)[self.rows]

    @property
    def velocity(self) -> np.ndarray:
        """True velocities of the motors, m/s or rad/s, ``(rows, motors)``; positive opens."""
        return self.plant.velocity[self.at]

    @property
    def pad_force(self) -> np.ndarray:
        """Contact forces of the last physics step before any scale, newtons, ``(rows, 2)``."""
        return self.plant.pad_force[self.at].copy()

    def reset(self, which: np.ndarray) -> None:
        """Gives these of its rows (indices into the effect's own rows) the memory of a new grasp."""
        self._weights.clear()
        for name, values in self.init(which).items():
            self.state[name][which] = values

    # --- hooks -------------------------------------------------------------------------------------------------

    def init(self, which: np.ndarray) -> State:
        """Memory of these of its rows at the start of a grasp, ``(len(which), ...)`` each; the plant stands there."""
        return {}

    def change_model(self, plant: Plant, which: np.ndarray) -> None:
        """Changes MuJoCo's per-simulation fields for these of its rows, in which they are those of the base model."""

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        """Commanded positions on their way to the motors, m or rad. ``fresh`` ``(rows,)``: this is a new command."""
        return command

    def commands(self, commands: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        """What :meth:`command` makes of the commands of many steps, the last ones of a grasp.

        Asked only of variants that are :attr:`known_beforehand`; an effect that can do it at once overrides it.

        Args:
          commands: ``(steps, rows, motors)``.
          fresh: which of them are new ones, ``(steps, rows)``.
        """
        return np.stack([self.command(*step) for step in zip(commands, fresh, strict=True)])

    def rests_at(self, command: np.ndarray) -> np.ndarray:
        """Where motors have come to rest in free air by commands ``(rows, motors)``, m or rad; grasps start there."""
        return command

    def motor_range(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest force that the motors may give in this step, N or N·m, ``(rows, motors)``."""
        return low, high

    def act(self) -> Contribution:
        """What it adds to this step: friction of the motors, forces on them, a shift of the pads."""
        return Contribution()

    def interaction(self, force: np.ndarray) -> np.ndarray:
        """True force between pads and object, before any scale, newtons."""
        return force

    def motor_position(self, joint: np.ndarray) -> np.ndarray:
        """Where the motors are, m or rad, ``(rows, motors)``, whose joints are there."""
        return joint

    def read_force(self, force: np.ndarray) -> np.ndarray:
        """What the force sensors say, newtons."""
        return force

    def read_position(self, position: np.ndarray) -> np.ndarray:
        """What the encoders say, m or rad."""
        return position

    def read_forces(self, forces: np.ndarray) -> np.ndarray:
        """What :meth:`read_force` makes of the forces of many steps, the last ones, ``(steps, rows, channels)``."""
        return np.stack([self.read_force(force) for force in forces])

    def read_positions(self, positions: np.ndarray) -> np.ndarray:
        """What :meth:`read_position` makes of those of many steps, the last ones, ``(steps, rows, motors)``."""
        return np.stack([self.read_position(position) for position in positions])

    # --- what the class knows about itself -----------------------------------------------------------------------

    @property
    def rank(self) -> tuple[int, int]:
        """Where it stands in the order in which effects act."""
        return STAGES.index(self.stage), self.order

    @property
    def is_known_beforehand(self) -> bool:
        """Whether all that it does to a grasp follows from the commands."""
        return self.variant in self.known_beforehand

    @classmethod
    @functools.cache
    def index(cls, parameter: str) -> int:
        """Which of the parameters has that name in the class that defines the effect."""
        return [p.name for p in cls.parameters].index(parameter)

    @classmethod
    def null_values(cls) -> np.ndarray:
        """Parameter values that leave every bit as it was, ``(parameters,)``."""
        return np.array([p.null for p in cls.parameters])

    @classmethod
    def typical_values(cls) -> np.ndarray:
        """Parameter values of a size worth noticing, ``(parameters,)``."""
        return np.array([p.typical for p in cls.parameters])

    @classmethod
    def trials(cls) -> np.ndarray:
        """Parameter values that a diagnosis tries, ``(trials, parameters)``: all combinations unless overridden."""
        return np.array(list(itertools.product(*(p.trials for p in cls.parameters))))

    @classmethod
    def at_whole_steps(cls, values: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray | float]:
        """Values with which it acts at whole physics steps ``dt``, and by how many seconds that is late, ``(rows,)``.

        Of what shifts all that happens in time, and nothing else, as a delay of commands does.
        """
        return values, 0.0

    @classmethod
    def hooks(cls) -> set[str]:
        """Names of the hooks that this effect overrides."""
        names = (
            "change_model",
            "command",
            "motor_range",
            "act",
            "interaction",
            "motor_position",
            "read_force",
            "read_position",
        )
        return {name for name in names if getattr(cls, name) is not getattr(Effect, name)}

    @classmethod
    def reads(cls) -> bool:
        """Whether it changes what is read."""
        return not cls.hooks().isdisjoint({"read_force", "read_position"})

    @classmethod
    def reads_only(cls, variant: str = "") -> bool:
        """Whether it changes what is read and nothing that happens, so that no simulation is needed to try it."""
        return cls.hooks() <= {"read_force", "read_position"}


def first_order_weight(dt: float, time_constant: np.ndarray | float) -> np.ndarray:
    """Share of the gap that a first-order lag closes in one step, 1 − exp(−dt/τ); 1 where τ is 0."""
    with np.errstate(divide="ignore"):
        return -np.expm1(-dt / np.asarray(time_constant, float))


def delay_line(past: np.ndarray, steps: np.ndarray, longest: float) -> State:
    """Memory of :func:`delayed` at the start.

    Args:
      past: what came before the first value, ``(rows, width)``; NaN stands for that value itself.
      steps: real number of steps by which each row is delayed, ``(rows, 1)``, or each of its values, ``(rows, width)``.
      longest: the longest delay that any row will have, in steps.
    """
    whole = np.floor(steps)
    return {
        "past": np.repeat(past[:, None], int(longest) + 2, axis=1),  # a ring, ``(rows, length, width)``
        "newest": np.zeros(len(past), int),
        "whole": whole.astype(int),
        "part": steps - whole,
    }


def all_delayed(line: State, signals: np.ndarray) -> np.ndarray:
    """What :func:`delayed` would return of the last steps' values ``(steps, rows, width)``, bit for bit."""
    past, part, whole = line["past"], line["part"], line["whole"]
    rows, (length, width) = np.arange(len(past))[:, None], past.shape[1:]
    before = past[rows, (line["newest"][:, None] + 1 + np.arange(length)) % length].swapaxes(0, 1)
    unknown = np.isnan(past[:, 0, 0])
    before[:, unknown] = signals[0, unknown]
    every = np.concatenate([before, signals])
    at = length + np.arange(len(signals))[:, None, None] - whole
    near, far = every[at, rows, np.arange(width)], every[at - 1, rows, np.arange(width)]
    return np.where(part == 0, near, (1 - part) * near + part * far)


def delayed(line: State, signal: np.ndarray) -> np.ndarray:
    """Takes a step's value ``(rows, width)`` and returns the delayed one, between the two nearest steps."""
    past, part = line["past"], line["part"]
    rows, (length, width) = np.arange(len(past)), past.shape[1:]
    unknown = np.isnan(past[:, 0, 0])
    if unknown.any():
        past[unknown] = signal[unknown, None]
    line["newest"] = newest = (line["newest"] + 1) % length
    past[rows, newest] = signal
    at = newest[:, None] - line["whole"]
    near = past[rows[:, None], at % length, np.arange(width)]
    far = past[rows[:, None], (at - 1) % length, np.arange(width)]
    return np.where(part == 0, near, (1 - part) * near + part * far)
