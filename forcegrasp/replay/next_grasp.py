"""The grasp that a diagnosis proposes: what is needed to record it, as its JSON file says it, and its commands."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import polars as pl
from pydantic import Field

from forcegrasp.errors import ConfigError, closest
from forcegrasp.files.bounded import read_bytes
from forcegrasp.files.validate import Record, refusal, validate
from forcegrasp.measure.schema import columns_of
from forcegrasp.physics.gripper import Gripper
from forcegrasp.replay.plans import MENU, OFF_CENTRE, PERIOD_S, SAMPLES, make_command

# Largest diagnosis that is read.
_MAX_BYTES = 50_000_000
_Positive = Annotated[float, Field(gt=0)]


class NextGrasp(Record):
    """One grasp on the menu, of an object of a set that was recorded."""

    grasp: str  #: its name on the menu
    object: str
    gripper: str  #: its name if it is shipped, else the path of its description
    radius_m: _Positive
    offset_m: float  #: where the object stands along the grasp axis
    contact: _Positive  #: position of the motors at first contact, m or rad
    squeeze: _Positive  #: deepest command beyond contact, m or rad

    def command(self, gripper: Gripper) -> np.ndarray:
        """What the motors are commanded, m or rad, ``(SAMPLES, motors)``, a row every ``PERIOD_S`` seconds."""
        return make_command(self.grasp, self.contact, gripper.stroke, self.squeeze, motors=len(gripper.motors))

    def write_commands(self, path: Path, gripper: Gripper) -> None:
        """Writes the commands as CSV: a row at each control period, columns named as in a set of the gripper.

        Raises:
          ConfigError: if the file can't be written.
        """
        time = np.arange(round(SAMPLES * PERIOD_S / gripper.period_s)) * gripper.period_s
        held = np.minimum((time / PERIOD_S + 1e-6).astype(int), SAMPLES - 1)
        columns = zip(columns_of(gripper).command, self.command(gripper)[held].T, strict=True)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            pl.DataFrame({"t_s": time.round(9)} | dict(columns)).write_csv(path)
        except OSError as error:
            raise ConfigError(f"{path}: could not write ({error.strerror})") from error


def read_next_grasp(path: Path, gripper: Gripper) -> NextGrasp:
    """Returns the grasp that a ``diagnosis.json`` proposes.

    Raises:
      ConfigError: if the file is no diagnosis, proposes no grasp, or is of another gripper.
    """
    place = f"next={path}"
    try:
        found = json.loads(read_bytes(path, _MAX_BYTES))
    except OSError as error:
        raise ConfigError(f"{place}: can't be read ({error.strerror}); give a diagnosis.json") from error
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict) or not {"verdict", "next_grasp"} <= set(found):
        raise ConfigError(f"{place}: is no diagnosis; give the diagnosis.json that forcegrasp diagnose wrote")
    proposed = found["next_grasp"]
    if proposed is None:
        raise ConfigError(f"{place}: proposes no grasp, for no two effects rival each other in it")
    if isinstance(proposed, dict):  # what else it says is for people
        proposed = {key: value for key, value in proposed.items() if key in NextGrasp.model_fields}
    grasp, kinds = validate(NextGrasp, proposed, f"{place}: next_grasp"), (*MENU, OFF_CENTRE)
    if grasp.grasp not in kinds:
        raise refusal(place, "next_grasp.grasp", f"no such grasp{closest(grasp.grasp, kinds)}")
    if grasp.gripper != gripper.name_or_path:
        raise refusal(
            place, "", f"is of gripper {grasp.gripper}, not {gripper.name_or_path}: give gripper={grasp.gripper}"
        )
    return grasp
