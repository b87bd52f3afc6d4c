"""The grasp that a diagnosis proposes: read from its file, written as commands, recorded on the same object."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from forcegrasp.errors import ConfigError
from forcegrasp.measure import read_set, write_set
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.replay.next_grasp import NextGrasp, read_next_grasp
from forcegrasp.replay.plans import MENU, OFF_CENTRE, make_command
from forcegrasp.replay.record import Recorded, record

TIAGO = load_gripper("tiago")
FACTS: dict[str, Any] = {
    "grasp": "long hold", "object": "object_2", "gripper": "tiago", "radius_m": 0.02, "offset_m": 0.0, "contact": 0.02,
    "squeeze": 0.003,
}  # fmt: skip


def made(next_grasp: NextGrasp | None = None, **options: Any) -> Recorded:
    usual = {"grasps": 2, "objects": 2, "effects": (), "known": {}, "off_nominal": 0.2, "seed": 15}
    noise = {"position_std_m": 2.7e-5, "force_std_n": 0.013}
    return record(TIAGO, "close_and_hold", **usual | noise | options, next_grasp=next_grasp)


def proposed(of: Recorded, **changes: Any) -> NextGrasp:
    radius = of.measured.grasps[1].radius_m
    return NextGrasp(**FACTS | {"radius_m": radius, "contact": float(TIAGO.contact_position(radius))} | changes)


def write(folder: Path, content: object) -> Path:
    path = folder / "diagnosis.json"
    path.write_text(json.dumps(content))
    return path


def test_the_file_says_all_that_is_needed(tmp_path):
    more = {"tells_apart": ["a", "b"], "differences": {"long hold": 3.1}, "bits": 0.9}
    path = write(tmp_path, {"verdict": "one_of", "next_grasp": FACTS | more})
    assert read_next_grasp(path, TIAGO) == NextGrasp(**FACTS)


def test_commands_are_those_of_the_menu():
    for kind in (*MENU, OFF_CENTRE):
        command = NextGrasp(**FACTS | {"grasp": kind}).command(TIAGO)
        assert np.array_equal(command, make_command(kind, 0.02, TIAGO.stroke, 0.003))


@pytest.mark.parametrize(("period", "repeats"), [(0.04, 1), (0.01, 4)])
@pytest.mark.parametrize("name", ["tiago", "robotiq_2f85"])
def test_commands_are_held_over_control_periods(name, period, repeats, tmp_path):
    gripper = dataclasses.replace(load_gripper(name), period_s=period)
    grasp = NextGrasp(**FACTS)
    grasp.write_commands(tmp_path / "new" / "next_grasp.csv", gripper)
    table = pl.read_csv(tmp_path / "new" / "next_grasp.csv")
    names = {"tiago": ["qdes_l_m", "qdes_r_m"], "robotiq_2f85": ["qdes_rad"]}[name]
    assert table.columns == ["t_s", *names]
    assert np.allclose(table["t_s"], np.arange(150 * repeats) * period)
    assert np.array_equal(table.select(names).to_numpy(), np.repeat(grasp.command(gripper), repeats, axis=0))


def test_it_is_recorded_on_the_object_of_the_set(tmp_path):
    plan = made()
    again = made(proposed(plan))
    (grasp,) = again.measured.grasps
    assert grasp.object == "object_2"
    assert np.array_equal(grasp.command_m, proposed(plan).command(TIAGO))
    for name in ("rho_m", "force_scale", "radius_m", "position_gain"):
        assert again.base[name] == plan.base[name][1], name
    assert (grasp.position_m - made(proposed(plan), seed=15).measured.grasps[0].position_m == 0).all()
    assert read_set(write_set(again.measured, tmp_path / "next")).fingerprint == again.measured.fingerprint


def test_its_noise_is_not_that_of_the_set():
    """The same commands as the set's second grasp."""
    plan, quiet = made(), {"position_std_m": 0.0, "force_std_n": 0.0}
    grasp = proposed(plan, grasp="close and hold", squeeze=TIAGO.stroke / 9)
    noise = [
        (noisy.measured.grasps[k].force_n - still.measured.grasps[k].force_n)[:, 0]
        for noisy, still, k in ((plan, made(**quiet), 1), (made(grasp), made(grasp, **quiet), 0))
    ]
    assert np.allclose(plan.measured.grasps[1].command_m, made(grasp).measured.grasps[0].command_m)
    assert abs(np.corrcoef(*noise)[0, 1]) < 0.3
    first = plan.measured.grasps[0].force_n - made(**quiet).measured.grasps[0].force_n
    assert abs(np.corrcoef(first[:, 0], noise[1])[0, 1]) < 0.3


@pytest.mark.parametrize(
    ("options", "changes", "words"),
    [
        ({"seed": 16}, {}, "'object_2' with a radius of .* mm, here it has .* mm; give objects, seed"),
        ({}, {"object": "sponge"}, "a grasp of 'sponge', here are object_1 to object_2"),
    ],
)
def test_another_object_is_refused(options, changes, words):
    with pytest.raises(ConfigError, match=words):
        made(proposed(made(), **changes), **options)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ([], "is no diagnosis; give the diagnosis.json"),
        ({"verdict": "effect"}, "is no diagnosis"),
        ({"verdict": "effect", "next_grasp": None}, "proposes no grasp"),
        ({"verdict": "one_of", "next_grasp": {"grasp": "a", "tells_apart": []}}, "next_grasp: object: missing"),
        ({"verdict": "one_of", "next_grasp": "long hold"}, "next_grasp: the file: must map grasp, object"),
        ({"verdict": "one_of", "next_grasp": FACTS | {"grasp": "long hole"}}, "no such grasp; did you mean long hold"),
        ({"verdict": "one_of", "next_grasp": FACTS | {"radius_m": -1.0}}, "radius_m: must be positive"),
        (
            {"verdict": "one_of", "next_grasp": FACTS | {"gripper": "franka_hand"}},
            "is of gripper franka_hand, not tiago: give gripper=franka_hand",
        ),
    ],
)
def test_what_is_no_next_grasp_is_refused_in_a_line(content, words, tmp_path):
    with pytest.raises(ConfigError, match=re.escape(words)) as caught:
        read_next_grasp(write(tmp_path, content), TIAGO)
    assert str(caught.value).startswith(f"next={tmp_path}")
    assert len(str(caught.value).splitlines()) == 1


def test_what_can_not_be_read_is_refused(tmp_path):
    (tmp_path / "text").write_text("{")
    with pytest.raises(ConfigError, match="is no diagnosis"):
        read_next_grasp(tmp_path / "text", TIAGO)
    for path in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(ConfigError, match="can't be read"):
            read_next_grasp(path, TIAGO)
