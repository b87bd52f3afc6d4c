"""Faults of a set that no effect stands for, each with the set put right, for the base model to be fitted again."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from forcegrasp.diagnosis.faults.even_stamps import are_even_in_truth, evenly, scatter_s
from forcegrasp.diagnosis.faults.felt_sizes import SEEN_M, doubtful_radii
from forcegrasp.diagnosis.faults.late_side import command_row_later, late_side
from forcegrasp.diagnosis.faults.linear_step import linear_step
from forcegrasp.diagnosis.faults.odd_grasps import odd_grasps
from forcegrasp.diagnosis.faults.recording_faults import RecordingFault, recording_faults
from forcegrasp.diagnosis.faults.session_drift import order_in_session, session_drift
from forcegrasp.diagnosis.faults.shifted_rows import WORTH_A_FIT, left_by_shift
from forcegrasp.diagnosis.faults.swapped_positions import positions_are_swapped, with_positions_swapped
from forcegrasp.diagnosis.faults.tolerance import MOST, WORTH, Moved, move_given, wanted_moves
from forcegrasp.diagnosis.signatures import Background
from forcegrasp.diagnosis.verdict import EXPLAINED, LEAST_SHARE
from forcegrasp.identify.base_fit import rms_error
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.target import Target
from forcegrasp.measure.check_givens import Tare, clock_factor, find_odd_zeros, find_tare, times
from forcegrasp.measure.force_units import find_odd_unit
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet
from forcegrasp.models.model_file import Fitted, Model
from forcegrasp.short_repr import ShortRepr, cut

# What a linear step makes of a change of zero is believed if it differs by no more than this share.
_OTHERWISE = 0.2
# What a scale or a ruler says of a recording's setting is right if it differs by no more than this share.
_SAME_SETTING = 0.02
# What readings say by themselves need only leave less, by however little: what the model lacks may leave far more.
_ANY = 0.0
# A set of which a fit leaves less than so many times the noise is not doubted.
_NOTHING = 1.03


@dataclass(frozen=True, repr=False)
class Fault(ShortRepr):
    """What may be wrong with a set, and the set without it."""

    name: str
    words: str  #: what seems to be wrong
    check: str  #: what to look at
    put_right: Loaded[MeasurementSet]
    moved: Moved | None = None  #: what was moved within the tolerance of what is given, so that it is no fault
    moved_besides: Moved | None = None  #: what was moved once it was put right
    then: Fault | None = None  #: what else was found wrong once it was put right
    #: What is given and is fitted instead, such as ``radius_m of sponge``, as the set has it.
    fitted: dict[str, float] = field(default_factory=dict)
    moves: dict[str, float] = field(default_factory=dict)  #: by how much a linear step moves what is given, by name
    least: float = SEEN_M  #: by how much less it is as given
    worth: float = EXPLAINED  #: least share of what is left beyond the noise that it must explain
    of_most: bool = False  #: radii of most objects are doubted, so that an effect may do as well, unless few were wrong
    wider: Fault | None = None  #: the same of more objects, to be tried if something is left
    #: The log itself says so, and what the model lacks may hide all that it explains: it need not leave less at first.
    of_log: bool = False
    part: str = ""  #: what of which recording is wrong, if it is one
    instead_of: str = ""  #: the one effect that it stands for where it is a rival; otherwise it stands for all

    @property
    def of(self) -> tuple[str, ...]:
        """What it is of, by which it is known again: its name, the part, and what is fitted instead."""
        return (self.name, self.part, *self.fitted)

    @property
    def all(self) -> tuple[Fault, ...]:
        """It, and whatever else was found wrong, in the order in which they were put right."""
        return (self, *(self.then.all if self.then is not None else ()))

    @property
    def names(self) -> tuple[str, ...]:
        """Of all, each once."""
        return tuple(dict.fromkeys(fault.name for fault in self.all))

    @property
    def moved_by(self) -> dict[str, float] | None:
        """By how much what is given was moved, by name as :attr:`.Moved.moves` has it; None if nothing was."""
        moves = [moved.moves for moved in (self.moved, self.moved_besides) if moved is not None]
        return {name: by for each in moves for name, by in each.items()} if moves else None

    def is_borne_out(self, fit: Fit) -> bool:
        """Whether a fit of the set put right, with the effects that were found, still puts elsewhere what was given."""
        wrong = self._still_wrong(fit)
        return bool(wrong) if self.of_most else len(wrong) == len(self.fitted)

    def is_of_few(self, fit: Fit) -> bool:
        """Whether a fit of the set put right puts fewer than half of the objects elsewhere: no effect is of so few."""
        return 2 * len(self._still_wrong(fit)) < len({grasp.object for grasp in fit.problem.grasps})

    def _still_wrong(self, fit: Fit) -> dict[str, tuple[float, float]]:
        """What a fit puts elsewhere than it was given: as fitted and as given, by name."""
        named = zip((entry.name for entry in fit.problem.entries), fit.values.tolist(), strict=True)
        values = {name: (value, self.fitted[name]) for name, value in named if name in self.fitted}
        return {name: (value, said) for name, (value, said) in values.items() if abs(value - said) > self.least}

    def told_by(self, fit: Fit) -> Fault:
        """The same with what a fit of the set put right makes of what is fitted."""
        told = [_told(name, value, said) for name, (value, said) in self._still_wrong(fit).items()]
        return dataclasses.replace(self, words="; ".join(told)) if told else self

    def begun_from(self, model: Model) -> Model:
        """A model with radii where a linear step leads from what the set says, for a fit of them to begin there.

        No slope leads from far away; and where a fit without them ended, none leads on.
        """
        objects = {name: dict(values) for name, values in model.objects.items()}
        for name, said in self.fitted.items():
            what, _, whose = name.partition(" of ")
            if what == "radius_m" and name in self.moves:
                begin = said + self.moves[name]
                objects.setdefault(whose, {})[what] = Fitted(begin, begin, begin, "m")
        return dataclasses.replace(model, objects=objects)

    def summary(self) -> str:
        return cut(f"{self.name}: {self.words}", 100)


def _told(name: str, value: float, said: float) -> str:
    """What was fitted, and what the set has for it."""
    what, _, whose = name.partition(" of ")
    if what == "radius_m":
        return f"the radius of {whose} is {1e3 * value:.1f} mm, the set says {1e3 * said:.1f} mm"
    return f"{name} is {value:.3g}, the set says {said:.3g}"


def besides(fault: Fault, then: Fault | None) -> Fault:
    """The fault, with what was moved, or put right as well, once it was."""
    if then is None:
        return fault
    if then.moved is None:
        return dataclasses.replace(fault, put_right=then.put_right, then=then)
    words = f"{fault.words}; then, {then.moved.how}, {then.words}"
    return dataclasses.replace(fault, words=words, put_right=then.put_right, moved_besides=then.moved)


def told_with(fault: Fault, other: Fault) -> Fault:
    """A fault that may not be one, with words of another that is."""
    words, check = (f"{getattr(fault, of)}; besides, {getattr(other, of)}" for of in ("words", "check"))
    return dataclasses.replace(fault, words=words, check=check)


def leaves_nothing(fit: Fit, target: Target) -> bool:
    """Whether a fit leaves too little for the set to be doubted."""
    return rms_error(fit, target) < _NOTHING


def suspects(loaded: Loaded[MeasurementSet], target: Target, fit: Fit) -> list[Fault]:
    """The faults that a set gives reason to look for.

    Args:
      loaded: grasps of a gripper, or recordings of a servo, as the set has them.
      target: the same, lined up.
      fit: of the base model.
    """
    if leaves_nothing(fit, target):
        return []
    if loaded.gripper.is_servo:
        return _of_recordings(loaded, target, fit)
    if any(grasp.like for grasp in odd_grasps(target, fit)):  # wrong labels may look like any other fault
        return []
    measured, first = loaded.measured, [*_of_clock(loaded), *_of_swapped(loaded, target, fit)]
    others = [*_of_zeros(loaded, target, fit), *_of_units(loaded), *_of_rows(loaded, target, fit)]
    # rows that do not keep step with commands make a clock seem off: that must not hide the rest
    all_of_clock = all(fault.name == "time_scale" for fault in (*first, *others))
    moved = wanted_moves(measured, target, fit) if all_of_clock else None
    most = None if moved is None or moved.is_within else most_radii(loaded, moved)
    if wrong := doubtful_radii(target, fit, measured.radius_std_m):
        wider = most if most is not None and set(most.fitted) > {f"radius_m of {name}" for name in wrong} else None
        # they are fitted beside all else; what is estimated once, as a change of zero, is right only after them
        return [*first, dataclasses.replace(_wrong_radii(loaded, wrong, moved), wider=wider), *others]
    if most is not None:
        return [*first, most]
    return [*first, moved_as_fault(loaded, moved)] if moved is not None and moved.is_within else [*first, *others]


def _of_clock(loaded: Loaded[MeasurementSet]) -> list[Fault]:
    """Time stamps in another unit."""
    measured = loaded.measured
    factor = clock_factor(measured, loaded.gripper.period_s, 1 + MOST * measured.period_std_share)
    if factor is None:
        return []
    words = f"time stamps are {times(factor)} for commands {loaded.gripper.period_s:g} s apart"
    right = _changed(loaded, lambda _, g: _slower(g, 1 / factor))
    return [Fault("time_scale", words, "the clock and unit of t_s", right, of_log=True)]


def _of_swapped(loaded: Loaded[MeasurementSet], target: Target, fit: Fit) -> list[Fault]:
    """Columns of positions that stand for one another; whatever is estimated beside them would come out wrong."""
    if not positions_are_swapped(target, fit):
        return []
    words = f"columns {listed(loaded.measured.columns.position)} stand for one another"
    check = "which encoder each column is written from: move one finger by hand"
    return [Fault("swapped_positions", words, check, _changed(loaded, lambda _, g: with_positions_swapped(g)))]


def _of_zeros(loaded: Loaded[MeasurementSet], target: Target, fit: Fit) -> list[Fault]:
    """Zeros or gains of forces that change."""
    measured = loaded.measured
    tare, drift, left = find_tare(measured), session_drift(target, fit), np.inf
    if tare is not None:
        tare, left = _sharper(tare, target, fit)
    if tare is not None and (drift is None or left <= drift.left):
        words = f"the zero changes at grasp {measured.grasps[tare.first].name}: {tare.words(measured)}"
        return [_tared(loaded, [tare], words, "whether sensors were set to zero there")]
    if drift is not None:
        order = order_in_session(measured.grasps)
        check = "whether sensors or motors warm up meanwhile: grasp one object first and last, and compare"
        right = _changed(loaded, lambda index, g: drift.taken_out(g, order[index]))
        words = drift.words(measured.columns.force)
        return [Fault(f"force_{drift.of}_drift", words, check, right, worth=LEAST_SHARE)]
    if odd := [_sharper(one, target, fit)[0] for one in find_odd_zeros(measured)]:
        each = [f"grasp {measured.grasps[one.first].name} ({one.words(measured)})" for one in odd]
        words = f"forces have another zero in {listed(each)} alone"
        return [_tared(loaded, odd, words, "whether sensors were set to zero there while something was held")]
    return []


def _of_units(loaded: Loaded[MeasurementSet]) -> list[Fault]:
    """A column of forces in another unit, or with another sign."""
    measured = loaded.measured
    if (unit := find_odd_unit(measured)) is None:
        return []
    words = f"column {measured.columns.force[unit.channel]} {unit.words(measured.grasps)}"
    right = _changed(loaded, lambda index, g: unit.put_right(g) if index in unit.grasps else g)
    check = "unit and sign of that column in the logs of these grasps"
    return [Fault("force_unit", words, check, right, worth=_ANY)]


def _of_rows(loaded: Loaded[MeasurementSet], target: Target, fit: Fit) -> list[Fault]:
    """Columns that are written to another row than the rest."""
    measured, found = loaded.measured, []
    if early := _early_readings(target, fit):
        late = ", or commands stand one row late" if len(early) > 1 else ""
        words = f"{listed(early)} are what was read one row later{late}"
        check = "which row each column was written to, and its clock"
        found.append(Fault("early_row", words, check, _changed(loaded, lambda _, g: _one_row_later(g, early))))
    if (side := late_side(target, fit)) is not None:
        words = f"what {measured.columns.command[side]} commands is done one row later, and by the other motor at once"
        check = "which row each motor's command was written to, and whether both get theirs at once"

        def right_side(_: int, grasp: MeasuredGrasp) -> MeasuredGrasp:
            return dataclasses.replace(grasp, command_m=command_row_later(grasp.command_m, side))

        found.append(Fault("late_side", words, check, _changed(loaded, right_side)))
    return found


def uneven_stamps(loaded: Loaded[MeasurementSet], target: Target, fit: Fit) -> Fault | None:
    """Time stamps that scatter though rows were read evenly; None if they don't, or stamps are right.

    Readings say so whatever the model lacks, and no effect does the like: it is put right before all else.

    Args:
      loaded, target, fit: as for :func:`suspects`.
    """
    if loaded.gripper.is_servo or leaves_nothing(fit, target) or not are_even_in_truth(target, fit):
        return None
    words = f"time stamps scatter by {1e3 * scatter_s(target):.2g} ms, and what was read is even in time"
    check = "whether rows are stamped when they are read, and not when they are written"
    return Fault("uneven_stamps", words, check, _changed(loaded, lambda _, g: evenly(g)))


def _of_recordings(loaded: Loaded[MeasurementSet], target: Target, fit: Fit) -> list[Fault]:
    """What one recording of a servo, or the clock of all, is seen to have otherwise than the set says."""
    return [_of_recording(loaded, one) for one in recording_faults(target, fit)]


def _of_recording(loaded: Loaded[MeasurementSet], wrong: RecordingFault) -> Fault:
    right = _changed(loaded, lambda _, g: wrong.put_right(g))
    fitted = wrong.fitted(loaded.measured.grasps)
    least = _SAME_SETTING * max(map(abs, fitted.values()), default=0.0)
    words, part = wrong.words(loaded.measured.columns.unit), f"{wrong.what} of {wrong.recording}"
    return Fault(wrong.name, words, wrong.check, right, fitted=fitted, least=least, part=part)


def _wrong_radii(loaded: Loaded[MeasurementSet], wrong: dict[str, float], moved: Moved | None) -> Fault:
    """Given radii, by object, are to be fitted instead, from where they are moved to."""
    words = f"fingers met {listed(list(wrong))} elsewhere than the set says"
    right = _changed(loaded, lambda _, g: dataclasses.replace(g, radius_m=None) if g.object in wrong else g)
    check = f"the radius of {listed(list(wrong))}, with a calliper: it may be another object's, or a diameter"
    fitted = {f"radius_m of {name}": said for name, said in wrong.items()}
    # what fingers felt is seen in the readings themselves: as much is enough as of an effect
    moves = {} if moved is None else moved.moves
    return Fault("object_radius", words, check, right, fitted=fitted, moves=moves, worth=LEAST_SHARE)


def most_radii(loaded: Loaded[MeasurementSet], moved: Moved) -> Fault | None:
    """Radii that are beyond their tolerance, some more and some less."""
    measured, apart = loaded.measured, moved.radii_apart()
    said = {g.object: g.radius_m for g in measured.grasps if g.object in apart and g.radius_m is not None}
    if not said:
        return None
    check = "the radii, with a calliper; were they measured by a ruler, meta.yaml may say object_radius_std_m"
    most = dataclasses.replace(_wrong_radii(loaded, said, moved), check=check, of_most=True)
    return dataclasses.replace(most, least=MOST * measured.radius_std_m)


def within_tolerance(
    loaded: Loaded[MeasurementSet], target: Target, fit: Fit, worth: float = WORTH, start: Moved | None = None
) -> Fault | None:
    """What was moved within the tolerance of what is given, if that explains this share of what a fit leaves.

    Args:
      loaded: grasps of a gripper, as the set has them.
      target: the same, lined up.
      fit: of the model.
      worth: least share of the squares beyond the noise.
      start: moves from which the fit started already.
    """
    moved = move_given(loaded.measured, target, fit, worth, start)
    return None if moved is None else moved_as_fault(loaded, moved)


def moved_as_fault(loaded: Loaded[MeasurementSet], moved: Moved) -> Fault:
    """A set whose givens were moved within their tolerance, which is no fault."""
    name, right = f"{'_and_'.join(moved.groups)}_tolerance", _changed(loaded, lambda _, g: moved.put(g))
    return Fault(name, moved.words(), moved.check, right, moved)


def _changed(
    loaded: Loaded[MeasurementSet], change: Callable[[int, MeasuredGrasp], MeasuredGrasp]
) -> Loaded[MeasurementSet]:
    """The set with each grasp changed by a function of its index and itself."""
    grasps = tuple(change(index, grasp) for index, grasp in enumerate(loaded.measured.grasps))
    return dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=grasps))


def _slower(grasp: MeasuredGrasp, factor: float) -> MeasuredGrasp:
    start = grasp.time_s[0]
    return dataclasses.replace(grasp, time_s=start + factor * (grasp.time_s - start))


def _sharper(tare: Tare, target: Target, fit: Fit) -> tuple[Tare, float]:
    """The same change as all readings have it, by a linear step from a fit; as it was where these say otherwise.

    Readings before contact, which show that a zero has changed, are few. Also what the step leaves beyond the noise.
    """
    changed = np.flatnonzero(tare.change_n)
    per_unit = np.zeros((*target.signals.shape, len(changed)))
    for column, channel in enumerate(changed):
        per_unit[tare.first : tare.end, :, target.axis.forces.start + channel, column] = 1.0
    step, left = linear_step(target, fit, Background(fit, ()), per_unit)
    change = tare.change_n.copy()
    change[changed] = np.where(
        np.abs(step - change[changed]) < _OTHERWISE * np.abs(change[changed]), step, change[changed]
    )
    return dataclasses.replace(tare, change_n=change), left


def _tared(loaded: Loaded[MeasurementSet], tares: Sequence[Tare], words: str, check: str) -> Fault:
    """Zeros that are others in some grasps, and the set with the usual ones there."""

    def levelled(index: int, grasp: MeasuredGrasp) -> MeasuredGrasp:
        changes = [tare.change_n for tare in tares if tare.first <= index < tare.end]
        return dataclasses.replace(grasp, force_n=grasp.force_n - sum(changes)) if changes else grasp

    return Fault("force_tare", words, check, _changed(loaded, levelled), worth=_ANY)


def _one_row_later(grasp: MeasuredGrasp, kinds: Sequence[str]) -> MeasuredGrasp:
    """The grasp less its first row, with readings of these kinds from the row before."""

    def moved(values: np.ndarray, kind: str) -> np.ndarray:
        return values[:-1] if kind in kinds else values[1:]

    return dataclasses.replace(
        grasp,
        time_s=grasp.time_s[1:],
        command_m=grasp.command_m[1:],
        position_m=moved(grasp.position_m, "positions"),
        force_n=moved(grasp.force_n, "forces"),
        object_m=None if grasp.object_m is None else grasp.object_m[1:],
        rows=None if grasp.rows is None else grasp.rows[1:],
    )


def _early_readings(target: Target, fit: Fit) -> tuple[str, ...]:
    """Which readings come before what makes them, and fit one row later; none if none do.

    No effect makes a reading early. Where positions and forces both are, the commands may be late.
    """
    background = Background(fit, ())
    least, best = (1 - WORTH_A_FIT) * max(0.0, left_by_shift(target, fit, background, [], later=True)), ()
    for kinds in (("position",), ("force",), ("position", "force")):
        parts = [target.axis.kinds.get(kind, slice(0, 0)) for kind in kinds]
        channels = [channel for part in parts for channel in range(part.start, part.stop)]
        left = left_by_shift(target, fit, background, channels, later=True)
        if left < least:
            least, best = left, tuple(f"{kind}s" for kind in kinds)
    return best
