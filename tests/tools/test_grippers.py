"""The program that measures each gripper: what it runs, that it goes on, and what it writes into the page."""

from __future__ import annotations

import pytest

from tools import grippers, grippers_page
from tools.marked_part import marks, with_part


def row(hidden: str, named: list[str], ratio: float, verdict: str = "effect") -> dict:
    return {"hidden": hidden, "named": named, "ratio": ratio, "verdict": verdict, "seconds": 60.0}


@pytest.mark.parametrize(
    ("found", "right"),
    [
        (row("backlash", ["backlash"], 1.05), True),
        (row("backlash", ["backlash"], 1.2), False),
        (row("backlash", ["backlash"], 1.05, "one_of"), False),
        (row("backlash", ["backlash", "force_lag"], 1.0), False),
        (row("backlash", [], 1.0, "explained"), False),
        (row(grippers.NOTHING, [], 1.3, "unknown"), True),
        (row(grippers.NOTHING, ["force_lag"], 1.0), False),
    ],
)
def test_right_is_what_was_hidden_and_nothing_else(found, right):
    assert grippers.is_right(found) == right


def test_dry_friction_is_hidden_where_effort_is_all_that_is_read():
    assert grippers.hidden_in("tiago") == ["backlash", "command_delay"]
    assert grippers.hidden_in("so101_gripper") == ["backlash", "command_delay", "coulomb_friction"]


def test_training_is_kept_and_not_done_again(tmp_path, monkeypatch, capsys):
    trained = []

    def train(gripper, frames, run):
        trained.append(gripper)
        run.mkdir()
        (run / "metrics.csv").write_text("frames,speed/frames_per_s\n100,50\n200,25\n")

    monkeypatch.setattr(grippers, "_train", train)
    monkeypatch.setattr(
        grippers, "evaluate", lambda gripper, policies, trials: {name: {"force_reward": 100.0} for name in policies}
    )
    arguments = ["--stage", "train", "--grippers", "tiago", "--frames", "200", "--trials", "1", "--out", str(tmp_path)]
    grippers.main(arguments)
    grippers.main(arguments)
    assert trained == ["tiago"]
    assert grippers.Results(tmp_path).of("train", "tiago")[0]["seconds"] == 2 + 4
    printed = capsys.readouterr().out
    assert "to train: tiago; 200 control steps each" in printed
    assert "to train: nothing" in printed


def test_policies_are_evaluated_on_the_same_few_grasps():
    found = grippers.evaluate("franka_hand", {"one": "force_pi", "still": "nothing"}, trials=1)
    assert found["one"]["force_reward"] > found["still"]["force_reward"]
    assert found["one"]["peak_force_n"] > 0.5
    assert found["still"]["moved_mm"] < 0.1


def test_report_fills_in_the_page_between_its_marks(tmp_path):
    results, page = grippers.Results(tmp_path), tmp_path / "page.md"
    begin, end = marks(grippers_page.WRITER)
    page.write_text(f"before\n{begin}\nold\n{end}\nafter\n")
    policy = {"force_reward": 121.23, "peak_force_n": 2.0, "overshoot_percent": 5.4, "moved_mm": 0.5}
    policies = {"policy": policy, "force_pi": policy | {"force_reward": 111.0}}
    results.add("a", {"stage": "train", "gripper": "tiago", "frames": 1000, "seconds": 90, "policies": policies})
    for number, named in enumerate((["backlash"], ["backlash"], [])):
        results.add(
            f"b{number}", {"stage": "diagnose", "gripper": "tiago"} | row("backlash", named, 1.0 + number / 100)
        )
    grippers_page.write(grippers.Results(tmp_path), ["tiago", "franka_hand"], grippers.is_right, page)
    text = page.read_text()
    assert text.startswith("before\n")
    assert text.endswith("\nafter\n")
    assert "old" not in text
    assert "| `tiago` | 1,000 | 1.5 | 121.2 / 111.0 | 2.00 / 2.00 | 5 / 5 | 0.50 / 0.50 |" in text
    assert "| `tiago` | backlash | 2 of 3 | 1.01 (1.02) | 60 |" in text
    assert "| `franka_hand` | – | – | – | – |" in text


def test_the_page_has_the_marks():
    text = grippers_page.PAGE.read_text("utf-8")
    assert with_part(text, grippers_page.WRITER, "new") != text
