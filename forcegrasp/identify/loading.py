"""A measurement set that was read and checked, with the gripper that it is of."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from forcegrasp.errors import ConfigError
from forcegrasp.identify.sensor_noise import check_given_noise
from forcegrasp.identify.windows import cut
from forcegrasp.measure import FinalForceTable, MeasurementSet, check_servo, check_set, check_table, read_set
from forcegrasp.measure.check_givens import check_givens
from forcegrasp.measure.checks import ALONE
from forcegrasp.measure.join import join, parts_of
from forcegrasp.models.model_file import Model
from forcegrasp.physics.gripper import SKEW, Gripper
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.short_repr import ShortRepr, counted

Measured = TypeVar("Measured", bound=MeasurementSet | FinalForceTable, covariant=True)


@dataclass(frozen=True, repr=False)
class Loaded(ShortRepr, Generic[Measured]):
    """A measurement set that was read and checked."""

    measured: Measured
    gripper: Gripper
    warnings: list[str]
    parts: tuple[Loaded[MeasurementSet], ...] = ()  #: of joined sets of grasps or recordings, each of them

    @property
    def held_out(self) -> int:
        """Number of grasps, or of windows of a servo's recordings, that can be held out one by one."""
        if not isinstance(self.measured, MeasurementSet):
            return 0
        grasps, gripper = self.measured.grasps, self.gripper
        return len(cut(grasps, gripper.parameters.get(SKEW)) if gripper.is_servo else grasps)

    def summary(self) -> str:
        return f"{self.measured.summary()}; {counted(len(self.warnings), 'warning')}"


def load(data: str | Path | Sequence[str | Path]) -> Loaded[MeasurementSet] | Loaded[FinalForceTable]:
    """Reads and checks a set, or several of one gripper, which are joined.

    Raises:
      MeasurementError: if the set can't be right, or the sets can't be joined.
      ConfigError: if its gripper is unknown, or the sets are of several.
    """
    paths = [data] if isinstance(data, (str, Path)) else list(data)
    if not paths:
        raise ConfigError("data=[]: name a set")
    loaded = [_load(path) for path in paths]
    return _joined(loaded) if len(loaded) > 1 else loaded[0]


def _load(path: str | Path) -> Loaded[MeasurementSet] | Loaded[FinalForceTable]:
    measured = read_set(path)
    gripper = load_gripper(measured.gripper, measured.path)
    if isinstance(measured, FinalForceTable):
        return Loaded(measured, gripper, check_table(measured, gripper.stroke))
    if gripper.is_servo:
        spans = [motor.stroke for motor in gripper.motors]
        return Loaded(measured, gripper, check_servo(measured, spans, gripper.unsigned, gripper.settings))
    half_opening_m = float(gripper.opening.opening_m[-1]) / 2
    warnings = check_set(measured, gripper.stroke, half_opening_m=half_opening_m, pads_at=gripper.pads_at)
    warnings += check_givens(measured, gripper.period_s)
    return Loaded(measured, gripper, warnings + check_given_noise(measured, gripper.unit))


def _joined(loaded: Sequence[Loaded[MeasurementSet] | Loaded[FinalForceTable]]) -> Loaded[Any]:
    first = loaded[0]
    for one in loaded[1:]:
        if _files(one.gripper) != _files(first.gripper):
            grippers = f"{one.gripper.name}, {first.measured.path} of {first.gripper.name}"
            raise ConfigError(f"{one.measured.path}: is of gripper {grippers}; only sets of one gripper can be joined")
    measured = join([one.measured for one in loaded], first.gripper.name_or_path)
    warned = [f"{one.measured.name}: {w}" for one in loaded for w in one.warnings if not w.endswith(ALONE)]
    named = [one.measured for one in loaded if isinstance(one.measured, MeasurementSet)]
    parts = parts_of(measured, named) if isinstance(measured, MeasurementSet) else []
    return Loaded(
        measured,
        first.gripper,
        [*warned, *measured.notes],
        tuple(Loaded(part, one.gripper, one.warnings) for part, one in zip(parts, loaded, strict=False)),
    )


def _files(gripper: Gripper) -> tuple[bytes, bytes]:
    """What a gripper is: each set may have a copy of its description."""
    return gripper.path.read_bytes(), gripper.model.read_bytes()


def warn_of_other_set(loaded: Loaded[MeasurementSet], model: Model, name: object) -> Loaded[MeasurementSet]:
    """The set, with a warning if a model says that it was fitted to another one; ``name`` is the model's file."""
    own = loaded.measured.fingerprint
    if model.data.get("fingerprint", own) == own:
        return loaded
    other = model.data.get("set", "a set without a name")
    warning = f"model={name}: was fitted to other measurements ({other}) than {loaded.measured.path}"
    return dataclasses.replace(loaded, warnings=[*loaded.warnings, warning])
