"""Sets and models say where their gripper is from where they are, so that a folder with all of them can be moved."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import yaml

from forcegrasp.files.neighbour import seen_from
from forcegrasp.identify.loading import load
from forcegrasp.measure import write_set
from forcegrasp.models.model_file import Fitted, Model, read_model, write_model
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.replay.record import record

GRIPPERS = Path(__file__).parent / "grippers"


def model_of(gripper: Gripper) -> Model:
    numbers = {p.name: p for p in gripper.parameters.values() if p.scope == "gripper"}
    return Model(gripper, {name: Fitted(p.nominal, p.low, p.high, p.unit) for name, p in numbers.items()})


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("{}/all/hand.yaml", "../hand.yaml"),
        ("{}/all/set/hand.yaml", "hand.yaml"),
        ("{}/all/set/hand", "./hand"),  # a bare word would be the name of a shipped one
        ("{}/elsewhere/hand.yaml", "{}/elsewhere/hand.yaml"),
        ("tiago", "tiago"),
        ("./hand.yaml", "./hand.yaml"),
    ],
)
def test_only_what_lies_within_is_named_from_the_folder(name, said, tmp_path):
    found = seen_from(tmp_path / "all" / "set", name.format(tmp_path), tmp_path / "all")
    assert found == said.format(tmp_path)


def test_a_folder_with_gripper_set_and_model_can_be_moved(tmp_path):
    here = tmp_path / "here"
    here.mkdir()
    for name in ("second.yaml", "second.xml"):
        shutil.copy(GRIPPERS / name, here)
    gripper = load_gripper(here / "second.yaml")
    made = record(gripper, "rich", grasps=1, objects=1, effects=[], known={}, off_nominal=0.1, seed=0,
                  position_std_m=2.7e-5, force_std_n=0.013)  # fmt: skip
    write_set(made.measured, here / "set")
    write_model(model_of(gripper), here / "model.yaml")
    assert yaml.safe_load((here / "set" / "meta.yaml").read_text())["gripper"] == "../second.yaml"
    assert yaml.safe_load((here / "model.yaml").read_text())["gripper"] == "second.yaml"
    before = load(here / "set")
    here.rename(tmp_path / "there")
    for found in (load(tmp_path / "there" / "set"), read_model(tmp_path / "there" / "model.yaml")):
        assert found.gripper.path.resolve() == tmp_path / "there" / "second.yaml"
    assert load(tmp_path / "there" / "set").measured.fingerprint == before.measured.fingerprint


def test_files_from_before_name_a_gripper_by_its_whole_path(tmp_path):
    gripper = load_gripper(GRIPPERS / "second.yaml")
    write_model(model_of(gripper), tmp_path / "model.yaml")
    assert yaml.safe_load((tmp_path / "model.yaml").read_text())["gripper"] == str(gripper.path.resolve())
    assert read_model(tmp_path / "model.yaml").gripper.name == gripper.name
