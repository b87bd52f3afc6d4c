"""``forcegrasp doctor data=SET``: what a set holds, what is odd in it, and what must be mended; without a fit."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.cli.main import main
from forcegrasp.measure import write_set


def said(capsys, folder) -> tuple[int, dict[str, list[str]]]:
    """Exit status, and level → lines."""
    status, found = main(["doctor", f"data={folder}"]), dict[str, list[str]]()
    for line in capsys.readouterr().out.splitlines()[:-1]:
        found.setdefault(line.split()[0], []).append(line)
    return status, found


def test_what_a_set_holds(measured, folder, capsys):
    status, found = said(capsys, folder)
    rows = sum(len(grasp.time_s) for grasp in measured.grasps)
    assert (status, set(found)) == (0, {"fine"})
    lines = " ".join(found["fine"])
    for told in (f"{len(measured.grasps)} grasps of", f"{rows} in 2 sessions", "40 ms apart", "q_l_m, q_r_m, f_l_n"):
        assert told in lines
    assert f"of positions is given: {measured.position_std_m:.3g} m" in lines
    assert f"of forces is given: {measured.force_std_n:.3g} N" in lines


def test_masses_of_objects(measured, tmp_path, capsys):
    grasps = [dataclasses.replace(g, mass_kg=None if i == 0 else 0.1 + 0.05 * i) for i, g in enumerate(measured.grasps)]
    write_set(dataclasses.replace(measured, grasps=tuple(grasps)), tmp_path / "set")
    _, found = said(capsys, tmp_path / "set")
    most = 0.1 + 0.05 * (len(grasps) - 1)
    assert any(f"in {len(grasps) - 1} grasps: 0.15 to {most:.3g} kg" in line for line in found["fine"])


def test_noise_that_is_not_given(measured, tmp_path, capsys):
    write_set(dataclasses.replace(measured, force_std_n=None), tmp_path / "set")
    status, found = said(capsys, tmp_path / "set")
    assert status == 0
    (line,) = found["note"]
    assert "of forces is not given" in line


def test_what_is_odd_is_a_warning(measured, tmp_path, capsys):
    slow = [dataclasses.replace(grasp, time_s=2 * grasp.time_s) for grasp in measured.grasps]
    write_set(dataclasses.replace(measured, grasps=tuple(slow)), tmp_path / "set")
    status, found = said(capsys, tmp_path / "set")
    assert status == 0
    assert any("2 times too long" in line for line in found["warning"])


@pytest.mark.parametrize("named", [True, False])
def test_what_cannot_be_right_is_to_be_mended(named, folder, capsys):
    if named:
        text = (folder / "samples.csv").read_text("utf-8")
        (folder / "samples.csv").write_text(text.replace("q_l_m", "q_left", 1), "utf-8")
    status, found = said(capsys, folder if named else folder / "nowhere")
    assert (status, set(found)) == (1, {"mend"})
    assert ("did you mean q_l_m?" if named else "no such measurement set") in found["mend"][0]


def test_stamps_that_scatter(measured, tmp_path, capsys):
    rng = np.random.default_rng(2)
    grasps = [
        dataclasses.replace(g, time_s=g.time_s + 0.002 * rng.standard_normal(len(g.time_s))) for g in measured.grasps
    ]
    write_set(dataclasses.replace(measured, grasps=tuple(grasps)), tmp_path / "set")
    status, found = said(capsys, tmp_path / "set")
    assert status == 0
    (line,) = found["note"]
    assert "ms apart (from 3" in line
    assert "uneven stamps" in line


@pytest.mark.parametrize(("factor", "told"), [(1.005, False), (1.06, True), (0.94, True), (1.5, False)])
def test_a_clock_that_is_off_by_more_than_its_tolerance(measured, tmp_path, capsys, factor, told):
    """Far off it is a warning of the set itself."""
    grasps = [dataclasses.replace(grasp, time_s=factor * grasp.time_s) for grasp in measured.grasps]
    write_set(dataclasses.replace(measured, grasps=tuple(grasps)), tmp_path / "set")
    _, found = said(capsys, tmp_path / "set")
    lines = [line for line in found.get("note", []) if "commands are" in line]
    assert len(lines) == told
    assert all(f"{factor - 1:+.1%}" in line and f"{40 * factor:.4g} ms apart" in line for line in lines)
