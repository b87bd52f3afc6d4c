"""What compare, fit, diagnose and add do alike: check where they are to write, read the set, write the report."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from forcegrasp.cli.results import write_json
from forcegrasp.errors import ConfigError

if TYPE_CHECKING:
    from typing_extensions import TypeIs

    from forcegrasp.diagnosis.add_effect import Added
    from forcegrasp.effects import Effect
    from forcegrasp.identify.loading import Loaded
    from forcegrasp.measure import FinalForceTable, MeasurementSet
    from forcegrasp.models.model_file import Model
    from forcegrasp.physics.gripper import Gripper
    from forcegrasp.reports.results import Result


#: With an effect added, the error must fall to less than this share.
LEAST_FALL = 0.995


def check_folder(folder: Path) -> Path:
    """Returns a folder that results can be written into, whether it is there or not.

    Raises:
      ConfigError: if it can't be: before hours of work, and not after.
    """
    there = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    if not there.is_dir():
        raise ConfigError(f"out={folder}: could not write, {there} is a file; name a folder")
    if not os.access(there, os.W_OK):
        raise ConfigError(f"out={folder}: could not write, {there} is not writable; name another folder")
    return folder


def check_file(file: Path) -> Path:
    """Returns a path that a model can be written to.

    Raises:
      ConfigError: if it can't be.
    """
    if file.is_dir():
        raise ConfigError(f"out={file}: could not write, it is a folder; name a file: out={file / 'model.yaml'}")
    check_folder(file.absolute().parent)
    return file


def take_model(path: Path, loaded: Loaded[MeasurementSet]) -> tuple[Model, Loaded[MeasurementSet]]:
    """Reads a model, and returns it and the set, with a warning if the model was fitted to another one."""
    from forcegrasp.identify.loading import warn_of_other_set
    from forcegrasp.models.model_file import read_model

    model = read_model(path)
    return model, warn_of_other_set(loaded, model, path)


def tell_warnings(loaded: Loaded) -> None:
    """Prints what is odd about a set."""
    for warning in loaded.warnings:
        print(f"warning: {warning}")


def write_results(out: Path, result: Result, show: Callable[[str], None] = print) -> Path:
    """Writes the report and the JSON file beside it, and says where; returns the report's path."""
    import mujoco

    from forcegrasp.reports.html import Section, Text, write_report

    sections, measured, warnings = result.sections(), result.data.measured, result.data.warnings
    if warnings:
        sections = [*sections, Section("Odd in this set", [Text(warning) for warning in warnings])]
    facts = {"set": str(measured.path), "gripper": measured.gripper, "source": measured.source}
    facts |= {"fingerprint": measured.fingerprint, "mujoco": mujoco.__version__}
    figures = out / f"{result.file}.json"
    write_json(figures, result.to_dict())
    report = write_report(out / "report.html", result.title, result.box(out), sections, facts)
    show(f"report: {report}, figures: {figures}")
    return report


def is_table(loaded: Loaded) -> TypeIs[Loaded[FinalForceTable]]:
    """Whether a set is a table of final forces."""
    from forcegrasp.measure import FinalForceTable

    return isinstance(loaded.measured, FinalForceTable)


def refuse_table(loaded: Loaded[MeasurementSet] | Loaded[FinalForceTable], verb: str) -> Loaded[MeasurementSet]:
    """Returns the set, but refuses a table of final forces.

    Raises:
      ConfigError: if the set is one.
    """
    if is_table(loaded):
        raise ConfigError(
            f"data={loaded.measured.path}: is a table of final forces, which fixes no model: it has no motion. "
            f"forcegrasp {verb} needs grasps; forcegrasp compare and forcegrasp diagnose read the table"
        )
    return loaded


def report_table(loaded: Loaded[FinalForceTable], name: str, out: Path, **unused: object) -> None:
    """Analyses a table of final forces, prints and writes what was found.

    Args:
      loaded: the set.
      name: "compare" or "diagnosis".
      out: where to write.
      unused: options that mean nothing to a table.

    Raises:
      ConfigError: if one of those is given.
    """
    refuse_options(loaded, **unused)
    from forcegrasp.final_force.analysis import analyse_table
    from forcegrasp.reports.final_force import lines
    from forcegrasp.reports.results import TableResult

    tell_warnings(loaded)
    result = TableResult(loaded, analyse_table(loaded.measured, loaded.gripper), name)
    for line in lines(result.analysis):
        print(line)
    write_results(out, result)


def refuse_options(loaded: Loaded[FinalForceTable], **unused: object) -> None:
    """Raises ConfigError if an option is given that means nothing to a table of final forces."""
    for option, value in unused.items():
        if value:
            raise ConfigError(
                f"{option}: {loaded.measured.path} is a table of final forces, which is held against the static law and"
                f" all shapes that effects give it; leave {option}= out"
            )


def refuse_one_grasp(loaded: Loaded[MeasurementSet]) -> None:
    """Raises ConfigError about a set of one grasp, of which none can be held out."""
    if loaded.held_out < 2:
        raise ConfigError(
            f"data={loaded.measured.path}: has one grasp, so that none can be held out to tell whether the error falls"
        )


def refuse_useless(added: Added, effect: type[Effect], way: str) -> None:
    """Raises ConfigError about an effect that does not lower the error on held-out grasps; ``way`` finds one."""
    before, after = added.error_before, added.error_after
    if not after < LEAST_FALL * before:
        raise ConfigError(
            f"effect={effect.name}: the error on held-out grasps does not fall ({before:.3f} × noise without,"
            f" {after:.3f} × with it); not written. To see what helps: {way}"
        )


def effect_to_add(name: str, gripper: Gripper) -> type[Effect]:
    """The effect of this name as a gripper has it, or the one that a file describes.

    Raises:
      ConfigError: if it is unknown, can't be read, or can't show on this gripper.
    """
    from forcegrasp.effects.for_gripper import effect_of
    from forcegrasp.effects.law import SUFFIXES, read_law

    return read_law(name, gripper) if name.endswith(SUFFIXES) else effect_of(name, gripper)


def check_effects(option: str, names: Sequence[str]) -> None:
    """Raises ConfigError about a name that no effect of the catalogue has, before anything is read."""
    from forcegrasp.effects.law import SUFFIXES
    from forcegrasp.effects.registry import catalogue, no_such_effect

    known = catalogue()
    for name in names:
        if name not in known and not (option == "effect" and name.endswith(SUFFIXES)):
            raise no_such_effect(f"{option}={name}", name, known)
