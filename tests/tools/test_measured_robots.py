"""The program that measures robots one by one: what it runs, that it goes on, and what it writes into the page."""

from __future__ import annotations

from pathlib import Path

import pytest

from forcegrasp.models.model_file import read_model
from tools import measured_robots
from tools.marked_part import marks
from tools.results import execute


@pytest.fixture
def ran(monkeypatch) -> list[list[str]]:
    """What is run; diagnoses find something, evaluations fail."""
    words = []

    def run(command: list[str]) -> int:
        words.append(command[1:])
        if command[1] == "diagnose":
            out = next(Path(word.removeprefix("out=")) for word in command if word.startswith("out="))
            out.mkdir()
            (out / "model.yaml").touch()
        return 3 if command[1] == "evaluate" else 0

    monkeypatch.setattr(execute, "run_command", run)
    return words


def test_a_run_that_stopped_goes_on_where_it_was(ran, tmp_path):
    for _ in range(2):
        with pytest.raises(SystemExit, match=r"robot 7: forcegrasp evaluate failed \(exit status 3\)"):
            measured_robots.work_through([7, 9], tmp_path, 1000)
    verbs = [words[0] for words in ran]
    assert verbs == ["robot", "record", "diagnose", "train", "train", "evaluate", "evaluate"]
    model, found = tmp_path / "robot_7" / "robot.yaml", tmp_path / "robot_7" / "why" / "model.yaml"
    assert [next(word for word in words if "model=" in word) for words in ran[3:5]] == [
        f"model={found}",
        f"model={model}",
    ]
    assert all("ppo.total_frames=1000" in words for words in ran[3:5])


def test_a_training_that_was_begun_is_resumed(tmp_path):
    begun = tmp_path / "retrained"
    begun.mkdir()
    (begun / "config.yaml").touch()
    steps = dict(measured_robots.commands(7, tmp_path, 1000))
    assert steps["retrained"] == ["train", f"resume={begun}"]
    assert steps["perfect"][1] == "experiment=retrain"


@pytest.mark.parametrize("named", [True, False], ids=["effects", "unknown"])
def test_it_learns_on_the_base_model_where_nothing_was_named(tmp_path, named):
    learnt_from = tmp_path / "why" / ("model.yaml" if named else "base_model.yaml")
    learnt_from.parent.mkdir()
    (tmp_path / "why" / "base_model.yaml").touch()
    learnt_from.touch()
    assert f"model={learnt_from}" in dict(measured_robots.commands(7, tmp_path, 1000))["retrained"]


def test_every_command_is_one_that_the_verbs_take(tmp_path, monkeypatch):
    from forcegrasp.cli.main import main

    monkeypatch.chdir(tmp_path)
    words = dict(measured_robots.commands(7, tmp_path, 1000))
    assert main(words["robot"]) == 0
    assert read_model(tmp_path / "robot.yaml").effects
    assert main([*words["measured"], "grasps=2"]) == 0
    for step in ("diagnosed", "retrained", "evaluated on simulator", "evaluated on robot"):
        assert main([*words[step], "no_such_option=1"]) == 2


def row(**values) -> dict:
    rewards = {"simulator": 115.0, "ib": 75.0, "catalogue": 80.0, "force_pi": 70.0, "retrained": 95.0, "perfect": 100.0}
    found = {"robot": 7, "hidden": 9, "found": 6, "others": [], "before": 9.0, "after": 1.2}
    return found | rewards | values


def test_the_table_has_a_row_for_each_robot_and_their_mean(tmp_path, monkeypatch):
    page = tmp_path / "robots.md"
    begin, end = marks(measured_robots.WRITER)
    page.write_text(f"before\n{begin}\nold\n{end}\nafter\n")
    rows = {7: row(), 9: row(robot=9, retrained=105.0, others=["stiction"])}
    for number in (9, 7):
        (tmp_path / f"robot_{number}" / "robot").mkdir(parents=True)
        (tmp_path / f"robot_{number}" / "robot" / "evaluation.json").touch()
    (tmp_path / "robot_11").mkdir()  # not done
    monkeypatch.setattr(measured_robots, "judged", lambda folder: rows[int(folder.name[6:])])
    measured_robots.report(tmp_path, page)
    text = page.read_text()
    assert text.startswith("before\n")
    assert text.endswith("\nafter\n")
    assert "old" not in text
    assert (tmp_path / "figures" / "measured_robots.png").stat().st_size > 5000
    lines = [line for line in text.splitlines() if line.startswith("|")][2:]
    assert lines[0] == "| 7 | 6 of 9 | | 9.0 → 1.20 | 115.0 | 75.0 | 80.0 | 70.0 | 95.0 | 100.0 | 50 % |"
    assert "`stiction`" in lines[1]
    assert lines[2].endswith("| 115.0 | 75.0 | 80.0 | 70.0 | 100.0 | 100.0 | 62 % |")


def test_nothing_done_is_said_in_a_line(tmp_path):
    with pytest.raises(SystemExit, match="no robot is done"):
        measured_robots.report(tmp_path)
