"""Replays a measurement set's commands, held as they were given, on simulated grippers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np

from forcegrasp.effects import Effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.errors import PhysicsError
from forcegrasp.measure.schema import MeasuredGrasp
from forcegrasp.physics.gripper import START_VELOCITY, Gripper
from forcegrasp.physics.plant import Plant, write_base
from forcegrasp.physics.sensors import ReadingEffects
from forcegrasp.replay.sample_steps import at_nearest_steps, fitting_factor, place_samples, steps_passed
from forcegrasp.replay.start import encoder_noise, start_position
from forcegrasp.replay.time_limit import check_time
from forcegrasp.short_repr import ShortRepr

#: Threads of the engine; 0 uses every core. Programs that run several diagnoses side by side set it to 1.
THREADS = 0
#: Rows × physics steps that are kept in memory at once.
_CHUNK = 8_000_000
#: Where a row is that diverged, m or rad, N or N·m: so far off that no search for parameters goes there.
NOWHERE = 1e6
# Motions that are kept; those of 24 grasps of 6 s take 3 MB.
_REMEMBERED = 16
#: What a driver reads of positions, m or rad, ``(n, motors)``, in these grasps, ``(n,)``, at these samples, ``(n,)``.
Reads = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False, repr=False)
class EffectOn(EffectSetting):
    """An effect on some of the rows that are simulated. ``values``: ``(len(rows), parameters)``."""

    rows: np.ndarray


@dataclass(frozen=True, repr=False)
class Motion(ShortRepr):
    """What happened in simulated rows, at the physics rate; not yet what sensors say of it."""

    grasp: np.ndarray  #: index of the measured grasp each row replays, ``(n,)``
    position: np.ndarray  #: of the motors, m or rad, ``(n, steps, motors)``
    force: np.ndarray  #: what the force readings transduce, before f_α, newtons, ``(n, steps, channels)``
    object_position: np.ndarray  #: metres, ``(n, steps)``
    late_s: np.ndarray  #: by how much later all this happened than it should have: it is read so much later, ``(n,)``


@dataclass(frozen=True, repr=False)
class Readings(ShortRepr):
    """What sensors say at the sample times; after a grasp's last sample, its last reading again."""

    position: np.ndarray  #: m or rad, ``(n, samples, motors)``
    force: np.ndarray  #: newtons, ``(n, samples, channels)``
    object_position: np.ndarray  #: metres, ``(n, samples)``


class Replay:
    """Replays grasps of one gripper.

    A command acts from the physics step at its time stamp until the next command's; a reading is the state at its time
    stamp, before that command acts. Of grasps physics steps are made to divide the time between two samples, that
    between any two anew if need be; of a servo, which may be sampled faster than that, a reading lies between two. So
    do readings that are taken later than their time stamps, or earlier. Of grasps, a command that is delayed acts at
    the next whole step, and all is read so much later: a motor at its limit gives for a part of a command as much as
    for the whole.

    Args:
      gripper: what is simulated.
      grasps: whose commands are replayed.
      tier: physics tier.
      step_factor: multiplies the physics step; ½ tells how exact the integration is.
      other_collisions: uses MuJoCo's other collision code; tells how exact the contacts are.
      encoders_known: the grasps hold measured positions, which the gripper's own driver may have acted on.
      start_off: by how many of their standard errors positions and velocities at the start are off, of each grasp to
        one side or the other; tells how much of what is predicted hangs on them.
      strict: whether rows must not diverge; by default they end :data:`NOWHERE`, lest one of many models that are tried
        ends the search, and :attr:`diverged` tells of the last one.
    """

    def __init__(
        self,
        gripper: Gripper,
        grasps: Sequence[MeasuredGrasp],
        tier: str = "reference",
        step_factor: float = 1.0,
        other_collisions: bool = False,
        encoders_known: bool = True,
        strict: bool = False,
        start_off: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self._strict, self.diverged = strict, ""
        self.gripper, self.grasps, self.tier = gripper, tuple(grasps), tier
        timestep = float(gripper.compile(tier).opt.timestep)
        self._step_factor = step_factor * (1.0 if gripper.is_servo else fitting_factor(self.grasps, timestep))
        self.dt, self._other_collisions = timestep * self._step_factor, other_collisions
        placed = (at_nearest_steps if gripper.is_servo else place_samples)(self.grasps, self.dt)
        starts, self._steps_at_once = placed.starts, placed.at_once
        self._steps = 1 + max(start[-1] for start in starts)
        samples = max(len(start) for start in starts)
        #: physics step at which each sample is taken, ``(grasps, samples)``
        self.sample_steps = np.stack([np.pad(start, (0, samples - len(start)), "edge") for start in starts])
        self._instants = self.sample_steps  # when each sample is taken, in steps
        latest_s = max(gripper.latest_reading_s, *(max(g.late_s) for g in self.grasps))
        more = math.ceil(latest_s / self.dt) + 1
        self._steps += more
        self._needed = np.array([start[-1] + more for start in starts])  # steps of each grasp until its last reading
        #: how many times as long as usual steps are, a row for so many at once, ``(…, grasps)``
        self._stretch = placed.lengths(self._steps)
        if gripper.is_servo:
            real = steps_passed(self.grasps, self.dt)
            self._instants = np.stack([np.pad(r, (0, samples - len(r)), "edge") for r in real])
        #: which samples there are, ``(grasps, samples)``
        self.mask = np.stack([np.arange(samples) < len(start) for start in starts])
        self._command = np.stack(
            [self._at_steps(g.command_m, s) for g, s in zip(self.grasps, starts, strict=True)], axis=1
        )
        self._encoder = np.stack(
            [self._at_steps(g.position_m, s) for g, s in zip(self.grasps, starts, strict=True)], axis=1
        )
        self._encoders_known = encoders_known
        self._fresh = np.zeros(self._command.shape[:2], bool)
        for index, start in enumerate(starts):
            self._fresh[start, index] = True
        #: Motions of all grasps that may be asked for again, by what was simulated; see :meth:`remember`.
        self.remembered: dict[bytes, Motion] = {}
        still, noise = np.zeros(len(gripper.motors)), encoder_noise(self.grasps)
        starts_at = [g.start or (start_position(g, gripper.stroke, noise), still) for g in self.grasps]
        #: where the motors stand at the first sample, m or rad, and how fast they move, ``(grasps, motors)``
        self.start_m, self._start_velocity = (np.stack([pair[i] for pair in starts_at]) for i in (0, 1))
        sides = np.random.default_rng(0).choice((-1.0, 1.0), (len(self.grasps), 1))
        unsure = [g.start_std or (still, still) for g in self.grasps]
        self.start_m += start_off[0] * sides * [pair[0] for pair in unsure]
        self._start_velocity += start_off[1] * sides * [pair[1] for pair in unsure]
        known = any(g.before is not None for g in self.grasps)
        at_rest = self.start_m if gripper.command == "position" else np.zeros_like(self.start_m)
        self._earlier = _earlier(self.grasps, self.dt, at_rest, self.start_m) if known else None
        self._disturbed = any(g.load is not None or g.enabled is not None for g in self.grasps)
        if self._disturbed:
            ones = [np.ones(len(g.time_s)) for g in self.grasps]
            loads = [np.zeros(len(o)) if g.load is None else g.load for g, o in zip(self.grasps, ones, strict=True)]
            enabled = [o if g.enabled is None else g.enabled for g, o in zip(self.grasps, ones, strict=True)]
            self._load, self._enabled = (
                np.stack([self._at_steps(np.asarray(v, float), s) for v, s in zip(values, starts, strict=True)], axis=1)
                for values in (loads, enabled)
            )

    def remember(self, key: bytes, motion: Motion, rows: np.ndarray) -> None:
        """Keeps these rows of a motion under a name; the ones kept longest ago are forgotten."""
        self.remembered.pop(key, None)  # it goes to the end
        self.remembered[key] = Motion(*(getattr(motion, field.name)[rows] for field in fields(Motion)))
        for oldest in list(self.remembered)[:-_REMEMBERED]:
            del self.remembered[oldest]

    def _at_steps(self, values: np.ndarray, starts: np.ndarray) -> np.ndarray:
        """The sample in force at each physics step."""
        return values[np.searchsorted(starts, np.arange(self._steps), side="right") - 1]

    def simulate(
        self,
        grasp: np.ndarray,
        base: Mapping[str, np.ndarray],
        effects: Sequence[EffectOn] = (),
        driver_reads: Reads | None = None,
    ) -> Motion:
        """Simulates rows at once, each one grasp with its own parameters.

        Args:
          grasp: which grasp each row replays, ``(n,)``.
          base: base parameters by name, each ``(n,)``, but those of readings.
          effects: those that change what happens.
          driver_reads: what the gripper's own driver reads with each new command, where grasps hold no measured
            positions; what encoders say, without noise, by default.

        Raises:
          PhysicsError: if a row diverged, and the replay is strict.
          OutOfTimeError: if the time within which all is to be done is over.
        """
        n, rows_at_once = len(grasp), max(1, _CHUNK // self._steps)
        if n > rows_at_once:
            parts = []
            for low in range(0, n, rows_at_once):
                part = slice(low, min(n, low + rows_at_once))
                chunk = {name: value[part] for name, value in base.items()}
                parts.append(self.simulate(grasp[part], chunk, [_cut(e, part) for e in effects], driver_reads))
            return join(parts)
        check_time()
        late_s = np.zeros(n)
        if not self.gripper.is_servo:
            effects = [self._at_whole_steps(e, late_s) for e in effects]
        plant = Plant(self.gripper, n, self.tier, THREADS, self._step_factor, self._other_collisions)
        attached = [(e.effect(e.values, self.dt, e.variant), e.rows) for e in effects if len(e.rows)]
        plant.attach(attached)
        ids, start = np.arange(n), self.start_m[grasp]
        for effect, rows in attached:
            start[rows] = effect.rests_at(start[rows])
        if not self.gripper.is_servo:  # logs of a servo begin in motion, and joints have another zero
            start = np.clip(start, *self.gripper.motor_range)
        offset = write_base(plant, ids, base)
        velocity = self._start_velocity[grasp] if self.gripper.is_servo else None
        if velocity is not None and START_VELOCITY in base:
            velocity = velocity + base[START_VELOCITY][:, None]
        plant.reset(ids, offset, start, velocity)
        if self._earlier is not None:
            plant.recall(*self._earlier, grasp)
        position, force = (np.empty((n, self._steps, width)) for width in (plant.motors, plant.channels))
        objects = np.empty((n, self._steps))
        position[:, 0], force[:, 0], objects[:, 0] = plant.position, plant.transduced_force, plant.object_position
        if not plant.acts_in_steps and not self._disturbed:
            commands = self._command[:-1, grasp].swapaxes(0, 1)
            fresh = self._fresh[:-1, grasp].T
            stretch = None if self._stretch is None else self._stretch[:, grasp]
            played = plant.play(commands, fresh, stretch, self._steps_at_once, self._needed[grasp])
            position[:, 1:], force[:, 1:], objects[:, 1:] = played
        else:
            needed = self._needed[grasp]
            for step in range(needed.max()):
                check_time()
                if (needed == step).any():
                    plant.run_only(np.flatnonzero(needed > step))
                new = self._fresh[step].take(grasp)
                if self._encoders_known:
                    plant.recorded_position = self._encoder[step].take(grasp, axis=0)
                elif driver_reads is not None and new.any():
                    sample = self._fresh[: step + 1, grasp].sum(axis=0) - 1
                    reads = driver_reads(plant.measured_position, grasp, sample)
                    before = reads if plant.recorded_position is None else plant.recorded_position
                    plant.recorded_position = np.where(new[:, None], reads, before)
                if self._disturbed:
                    plant.disturb(self._load[step, grasp], self._enabled[step, grasp] > 0)
                if self._stretch is not None and step % self._steps_at_once == 0:
                    plant.stretch_steps(self._stretch[step // self._steps_at_once, grasp])
                plant.advance(self._command[step].take(grasp, axis=0), 1, new)
                position[:, step + 1], force[:, step + 1] = plant.position, plant.transduced_force
                objects[:, step + 1] = plant.object_position
            for held in (position, force, objects):
                held[:, needed.max() + 1 :] = held[:, needed.max()][:, None]
        bad = plant.warnings().any(axis=1)
        if bad.any():
            row = int(np.flatnonzero(bad)[0])
            values = ", ".join(f"{name}={value[row]:.4g}" for name, value in base.items())
            name = f"{'window' if self.gripper.is_servo else 'grasp'} {self.grasps[grasp[row]].name}"
            self.diverged = f"{name} diverged with {values}; narrow the gripper's bounds"
            if self._strict:
                raise PhysicsError(self.diverged)
            position[bad] = force[bad] = NOWHERE
        return Motion(grasp, position, force, objects, late_s)

    def _at_whole_steps(self, one: EffectOn, late_s: np.ndarray) -> EffectOn:
        """An effect that acts at physics steps; adds to ``late_s`` of its rows by how much that is too late."""
        values, late = one.effect.at_whole_steps(one.values, self.dt)
        late_s[one.rows] += late
        return EffectOn(*one.kind, values, one.rows)

    def read(
        self,
        motion: Motion,
        rows: np.ndarray,
        force_scale: np.ndarray,
        effects: Sequence[EffectOn] = (),
        skew_s: np.ndarray | None = None,
        force_skew_s: np.ndarray | None = None,
    ) -> Readings:
        """Reads rows of a motion through sensors.

        Args:
          motion: what happened.
          rows: which row of the motion each reading is of, ``(n,)``; the same row may be read in several ways.
          force_scale: f_α, ``(n,)``.
          effects: those that change what is read; their rows count readings.
          skew_s: how much later than its command each row's samples were read, ``(n,)``; at its time stamp by default.
          force_skew_s: the same of the forces, if they were not read with the positions.
        """
        late_s = motion.late_s[rows]
        at = self._when(motion.grasp[rows], late_s if skew_s is None else skew_s + late_s)
        of_force = at if force_skew_s is None else self._when(motion.grasp[rows], force_skew_s + late_s)
        position, objects = at.of(motion.position, rows), at.of(motion.object_position, rows)
        scale = force_scale[:, None, None]
        if not effects:
            return Readings(position, of_force.of(motion.force, rows, lambda f: self._transduced(f * scale)), objects)
        force = self._transduced(motion.force[rows] * scale)
        live = ReadingEffects([self._on_readings(effect) for effect in effects])
        true_position = motion.position[rows] if live.change_position else motion.position[:0]
        live.apply_to_all(true_position, force)
        count = np.arange(len(rows))
        if live.change_position:
            position = at.of(true_position, count)
        return Readings(position, of_force.of(force, count), objects)

    def _when(self, grasp: np.ndarray, skew_s: np.ndarray) -> _Instants:
        """When the samples of these grasps are read."""
        later = skew_s / self.dt
        if self._instants is self.sample_steps and not later.any():
            return _Instants(self.sample_steps[grasp])
        instants = np.clip(self._instants[grasp] + later[:, None], 0, self._steps - 1)
        before = np.minimum(instants.astype(int), self._steps - 2)
        return _Instants(before, instants - before)

    def _transduced(self, force: np.ndarray) -> np.ndarray:
        """What goes into force readings: all of it, or its size."""
        return np.abs(force) if self.gripper.unsigned else force

    def _on_readings(self, one: EffectOn) -> Effect:
        """An effect that changes what is read, on its readings, without a plant."""
        effect = one.effect(one.values, self.dt, one.variant)
        effect.rows = np.asarray(one.rows)
        return effect


@dataclass(frozen=True)
class _Instants:
    """When samples are read: at physics steps, or between two of them."""

    before: np.ndarray  #: the last physics step until then, ``(n, samples)``
    share: np.ndarray | None = None  #: of the step after it that has passed; None for none

    def of(
        self, values: np.ndarray, rows: np.ndarray, seen: Callable[[np.ndarray], np.ndarray] = lambda v: v
    ) -> np.ndarray:
        """What is read of these rows of what sensors see of values ``(m, steps, ...)``: ``(n, samples, ...)``."""
        each = np.asarray(rows)[:, None]
        before = seen(values[each, self.before])
        if self.share is None:
            return before
        share = self.share.reshape(*self.share.shape, *(1,) * (before.ndim - 2))
        return before + share * (seen(values[each, self.before + 1]) - before)


def _earlier(
    grasps: Sequence[MeasuredGrasp], dt: float, at_rest: np.ndarray, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What was commanded in the steps before the first sample, which were new commands, and where the motors were.

    Args:
      grasps: all, or none of them with samples before.
      dt: physics step, seconds.
      at_rest: what was commanded before the first command that is known, ``(grasps, motors)``.
      start: where the motors stood before the first position that is known, ``(grasps, motors)``.

    Returns:
      ``(grasps, steps, motors)``, ``(grasps, steps)`` and ``(grasps, steps, motors)``.
    """
    before = [(np.empty(0), g.command_m[:0], g.position_m[:0]) if g.before is None else g.before for g in grasps]
    steps = max(math.ceil(-time[0] / dt) if len(time) else 0 for time, _, _ in before)
    commands, moved = (np.repeat(values[:, None], steps, axis=1) for values in (at_rest, start))
    fresh = np.zeros(commands.shape[:2], bool)
    for index, (time, command, position) in enumerate(before):
        if len(time):
            for motor, values in enumerate(position.T):
                known = np.arange(-steps, 0) * dt >= time[0]
                moved[index, known, motor] = np.interp(np.arange(-steps, 0)[known] * dt, time, values)
            first = np.minimum(steps + np.rint(time / dt).astype(int), steps - 1)
            fresh[index, first] = True
            latest = np.searchsorted(first, np.arange(steps), side="right") - 1
            commands[index, latest >= 0] = command[latest[latest >= 0]]
    return commands, fresh, moved


def join(motions: Sequence[Motion]) -> Motion:
    """The rows of several motions, one after the other."""
    if len(motions) == 1:
        return motions[0]
    return Motion(*(np.concatenate([getattr(m, field.name) for m in motions]) for field in fields(Motion)))


def _cut(effect: EffectOn, part: slice) -> EffectOn:
    inside = (effect.rows >= part.start) & (effect.rows < part.stop)
    return EffectOn(*effect.kind, effect.values[inside], effect.rows[inside] - part.start)
