"""The comparison knows no gripper by itself: the second one, with directions of its own, is diagnosed alike."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.loading import load
from forcegrasp.measure import write_set
from forcegrasp.models.model_file import read_model, write_model
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.replay.record import parse_effect, record
from tests.made_up import shortened

SECOND = Path(__file__).parent.parent / "grippers" / "second.yaml"


@pytest.mark.long
def test_finds_what_was_hidden_in_another_gripper(tmp_path):
    recorded = record(
        load_gripper(str(SECOND)),
        "rich",
        grasps=6,
        objects=1,
        effects=[parse_effect("force_lag time_constant_s=0.1", load_gripper(str(SECOND)))],
        known={},
        off_nominal=0.1,
        position_std_m=3e-5,
        force_std_n=0.02,
        seed=4,
    )
    write_set(shortened(recorded.measured, 60), tmp_path / "set")
    loaded = load(tmp_path / "set")
    assert loaded.gripper.name == load_gripper(str(SECOND)).name
    names = ["force_lag", "force_bias"]
    diagnosis, _ = diagnose_set(loaded, None, names, 0, lambda text: None)
    assert (diagnosis.verdict, diagnosis.effects) == ("effect", ("force_lag",))
    assert diagnosis.error_after < 1.1 * diagnosis.floor < 1.2 * diagnosis.error_before

    model = model_of(diagnosis.fit, diagnosis.target, loaded, [])
    write_model(model, tmp_path / "model.yaml")
    again = read_model(tmp_path / "model.yaml")
    assert np.isclose(again.effects[0].values[0], 0.1, rtol=0.05)
    for name, fitted in again.base.items():
        assert np.isclose(fitted.value, recorded.base[name][0], rtol=0.05), name
