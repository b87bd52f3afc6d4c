"""A fault of a set that no effect stands for, with the set put right, for the base model to be fitted again."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field

from forcegrasp.diagnosis.faults.felt_sizes import SEEN_M
from forcegrasp.diagnosis.faults.tolerance import Moved
from forcegrasp.diagnosis.verdict import EXPLAINED
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.loading import Loaded
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet
from forcegrasp.models.model_file import Fitted, Model
from forcegrasp.short_repr import ShortRepr, cut

#: What readings say by themselves need only leave less, by however little: what the model lacks may leave far more.
ANY = 0.0


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


def with_each(
    loaded: Loaded[MeasurementSet], change: Callable[[int, MeasuredGrasp], MeasuredGrasp]
) -> Loaded[MeasurementSet]:
    """The set with each grasp changed by a function of its index and itself."""
    grasps = tuple(change(index, grasp) for index, grasp in enumerate(loaded.measured.grasps))
    return dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=grasps))
