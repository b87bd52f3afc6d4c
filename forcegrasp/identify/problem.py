"""The parameters that a fit may change, as one vector."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.predict import Case
from forcegrasp.identify.priors import Priors
from forcegrasp.measure.schema import MeasuredGrasp
from forcegrasp.measure.servo_set import settings_of
from forcegrasp.physics.gripper import FORCE_SKEW, MASS, SKEW, Gripper
from forcegrasp.physics.gripper_parts import BaseParameter
from forcegrasp.short_repr import ShortRepr

# A setting that is not known is at most so many times what other recordings have, or the inverse.
_BEYOND_OTHERS = 4.0


@dataclass(frozen=True, repr=False)
class Entry(ShortRepr):
    """One number that a fit may change."""

    name: str  #: for people: "rho_m of sponge", "backlash.gap_m"
    parameter: str
    effect: int | None  #: index into the problem's effects; None for a base parameter
    members: np.ndarray  #: which grasps it concerns, ``(G,)``
    start: float
    low: float
    high: float
    unit: str
    logarithmic: bool
    scale: float  #: a change of this size is worth noticing, in its own unit; 1 for logarithms
    null: float = float("nan")  #: where an effect's parameter does nothing; base parameters have no such value
    jumps: bool = False  #: whether what it does stays as it is, jumps, and stays again: no slope tells where to
    std: float = float("inf")  #: how far it is from its start, standard deviation of the prior, in its own unit

    def coordinate(self, value: float) -> float:
        """The fit's own coordinate of a value; differences of 1 are large."""
        if self.logarithmic:
            return float(np.log(np.clip(value, self.low, self.high)))
        return float(np.clip(value, self.low, self.high) / self.scale)

    def value(self, coordinate: float) -> float:
        """The inverse of :meth:`coordinate`."""
        if self.logarithmic:  # of a parameter that nothing fixes, an interval's end is beyond all numbers
            coordinate = np.exp(np.clip(coordinate, np.log(self.low), np.log(self.high)))
        return float(np.clip(coordinate * self.scale, self.low, self.high))

    @property
    def precision(self) -> float:
        """One over the prior's standard deviation in coordinates; 0 without a prior."""
        return (self.start if self.logarithmic else self.scale) / self.std


class Problem:
    """Base parameters of a gripper on given grasps, and chosen effects.

    Per-object parameters have one entry for each object; a radius or an offset has one only where the set does not
    give it, and so has a setting of a servo's recording (NaN there). One that is given, but to be fitted within its
    tolerance, has one with a Gaussian prior.

    Args:
      gripper: the model under test.
      grasps: the measured grasps.
      effects: those in the model, with the values that a fit starts from.
    """

    def __init__(
        self, gripper: Gripper, grasps: Sequence[MeasuredGrasp], effects: Sequence[EffectSetting] = ()
    ) -> None:
        self.gripper, self.grasps, self.effects = gripper, tuple(grasps), tuple(effects)
        #: which base parameters a setting of a recording multiplies
        self._multiplied: dict[str, list[str]] = {}
        for p in gripper.parameters.values():
            if p.times:
                self._multiplied.setdefault(p.times, []).append(p.name)
        self._given = (
            {
                name: np.array([g.settings[name] for g in grasps])
                for name in settings_of(gripper)
                if all(name in g.settings for g in grasps)
            }
            if gripper.is_servo
            else {
                "radius_m": np.array([np.nan if g.radius_m is None else g.radius_m for g in grasps]),
                "offset_m": np.array([np.nan if g.offset_m is None else g.offset_m for g in grasps]),
                SKEW: np.array([g.late_s[0] for g in grasps]),
                FORCE_SKEW: np.array([g.late_s[1] for g in grasps]),
            }
        )
        masses = np.array([np.nan if g.mass_kg is None else g.mass_kg for g in grasps])
        if np.isfinite(masses).any():
            self._given[MASS] = masses
        stds = np.array([g.fitted_m for g in grasps]).reshape(-1, 2).T
        #: what is given and fitted all the same: values and standard deviations, ``(G,)`` each
        self._expected = {
            name: (self._given[name], std)
            for name, std in zip(("radius_m", "offset_m"), stds, strict=True)
            if std.any()
        }
        self._given |= {name: np.where(std > 0, np.nan, given) for name, (given, std) in self._expected.items()}
        self.entries = [*self._base_entries(), *self._setting_entries(), *self._effect_entries()]
        self.low = np.array([e.coordinate(e.low) for e in self.entries])
        self.high = np.array([e.coordinate(e.high) for e in self.entries])
        #: Which grasps each entry concerns, ``(G, entries)``.
        self.concerned = (
            np.array([e.members for e in self.entries], bool).reshape(len(self.entries), len(self.grasps)).T
        )
        self.priors = Priors(self.start(), np.array([e.precision for e in self.entries]))

    def __len__(self) -> int:
        return len(self.entries)

    def _base_entries(self) -> list[Entry]:
        owners = {
            "object": np.array([g.object for g in self.grasps]),
            "recording": np.array([g.session for g in self.grasps]),
        }
        entries = []
        for parameter in self.gripper.parameters.values():
            free = np.isnan(self._given.get(parameter.name, np.full(len(self.grasps), np.nan)))
            if parameter.scope == "gripper":
                groups = {parameter.name: free}
            elif parameter.scope in owners:
                owner = owners[parameter.scope]
                groups = {f"{parameter.name} of {one}": free & (owner == one) for one in dict.fromkeys(owner)}
            else:
                groups = {
                    f"{parameter.name} of grasp {g.name}": free & (np.arange(len(self.grasps)) == i)
                    for i, g in enumerate(self.grasps)
                }
            scale = 1.0 if parameter.logarithmic else (abs(parameter.nominal) or (parameter.high - parameter.low) / 10)
            for name, members in groups.items():
                if members.any():
                    start, std = self._expected_of(parameter, members)
                    kind = (parameter.low, parameter.high, parameter.unit, parameter.logarithmic, scale)
                    entries.append(Entry(name, parameter.name, None, members, start, *kind, std=std))
        return entries

    def _expected_of(self, parameter: BaseParameter, members: np.ndarray) -> tuple[float, float]:
        """Where a parameter starts in these grasps, and its prior's standard deviation; infinite without a prior."""
        if parameter.name in self._expected:
            given, std = (float(values[members][0]) for values in self._expected[parameter.name])
            if np.isfinite(given) and std > 0:
                return given, std
        return parameter.nominal, np.inf

    def _setting_entries(self) -> list[Entry]:
        """What was set for some of a servo's recordings, and is not known: not far beyond what others have."""
        entries, sessions = [], np.array([g.session for g in self.grasps])
        for name, given in self._given.items() if self.gripper.is_servo else ():
            unknown = np.isnan(given)
            if name in self.gripper.parameters or unknown.all() or not unknown.any():
                continue
            known = given[~unknown]
            usual, low, high = float(np.median(known)), float(known.min()), float(known.max())
            if positive := low > 0:
                low, high, scale = low / _BEYOND_OTHERS, high * _BEYOND_OTHERS, 1.0
            else:
                scale = max(high - low, -low, 1e-9)
                low, high = low - scale, high + scale
            for one in dict.fromkeys(sessions[unknown]):
                members = unknown & (sessions == one)
                entries.append(Entry(f"{name} of {one}", name, None, members, usual, low, high, "", positive, scale))
        return entries

    def _effect_entries(self) -> list[Entry]:
        entries = []
        for index, one in enumerate(self.effects):
            for place, (p, value) in enumerate(zip(one.effect.parameters, one.values, strict=True)):
                scale = 1.0 if p.logarithmic else abs(p.typical)
                bounds = (float(value), p.low, p.high, p.unit)
                everyone = np.ones(len(self.grasps), bool)
                name, jumps = f"{one.effect.name}.{p.name}", one.effect.in_steps and place == 0
                kind = (p.logarithmic, scale, p.null, jumps)
                entries.append(Entry(name, p.name, index, everyone, *bounds, *kind))
        return entries

    def first_entry(self, effect: int) -> int:
        """Index of the first parameter of one of the effects; the others of it follow."""
        return [entry.effect for entry in self.entries].index(effect)

    def start(self) -> np.ndarray:
        """Nominal base parameters, and effects as they were given, ``(entries,)``."""
        return np.array([e.coordinate(e.start) for e in self.entries])

    def values(self, vector: np.ndarray) -> np.ndarray:
        """Parameters in their own units, ``(entries,)``."""
        return np.array([entry.value(x) for entry, x in zip(self.entries, vector, strict=True)])

    def case(self, vector: np.ndarray) -> Case:
        """The model that a vector stands for."""
        base = {name: given.copy() for name, given in self._given.items()}
        base |= {name: np.full(len(self.grasps), np.nan) for name in self.gripper.parameters if name not in base}
        numbers: list[list[float]] = [[] for _ in self.effects]
        for entry, value in zip(self.entries, self.values(vector), strict=True):
            if entry.effect is None:
                base[entry.parameter][entry.members] = value
            else:
                numbers[entry.effect].append(value)
        for setting, parameters in self._multiplied.items():
            factor = base[setting] if setting in self.gripper.settings else base.pop(setting)
            base |= {name: base[name] * factor for name in parameters}
        base.setdefault("force_scale", np.ones(len(self.grasps)))
        pairs = zip(self.effects, numbers, strict=True)
        return Case(base, tuple(dataclasses.replace(one, values=np.array(values)) for one, values in pairs))

    def columns(self) -> list[list[int]]:
        """Entries that can be varied together, for no grasp follows two of them: one simulation gives all of them."""
        groups: dict[tuple[str, int | None], list[int]] = {}
        for index, entry in enumerate(self.entries):
            groups.setdefault((entry.parameter, entry.effect), []).append(index)
        return list(groups.values())
