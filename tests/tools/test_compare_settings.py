"""The program that trains with several settings: what it runs, that it goes on, its tables and its picture."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from forcegrasp.cli.main import main
from tools import compare_settings
from tools.compare_settings import COMPARISONS, Comparison
from tools.marked_part import marks
from tools.results import execute

TINY = ["ppo.total_frames=16", "ppo.grasps=4", "ppo.minibatch=4", "grasp.steps=4", "ppo.hidden=[4]", "seed=1,2"]
TWO = Comparison("page.md", {"quick": "experiment=quick", "sac": "experiment=quick learner=sac"}, picture=True)


@pytest.mark.parametrize("name", COMPARISONS)
def test_every_setting_is_one_that_training_takes(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for options in COMPARISONS[name].settings.values():
        train, evaluate = compare_settings.commands(options, tmp_path / "runs", tmp_path / "out", 5)
        assert set(options.split()) <= set(train)
        assert main([*train, "no_such_option=1"]) == 2
        assert main([*evaluate, "no_such_option=1"]) == 2
    assert not list(tmp_path.iterdir())


def test_what_was_stopped_goes_on_and_what_is_done_stays(tmp_path, monkeypatch):
    ran = []
    monkeypatch.setattr(execute, "run_command", lambda words: ran.append(words[1:]) or 3)
    done = tmp_path / "evaluations" / "quick"
    done.mkdir(parents=True)
    (done / "evaluation.json").touch()
    for _ in range(2):
        with pytest.raises(SystemExit, match=r"sac: forcegrasp train failed \(exit status 3\)"):
            compare_settings.work_through(TWO, tmp_path, 2)
        (tmp_path / "sac").mkdir(exist_ok=True)
        (tmp_path / "sac" / "multirun.yaml").touch()
    assert {"learner=sac", "seed=range(1,3)"} < set(ran[0])
    assert ran[1] == ["train", "-m", f"resume={tmp_path / 'sac'}"]


@pytest.mark.long
def test_the_table_has_all_seeds_of_what_is_done(tmp_path, monkeypatch):
    monkeypatch.setitem(COMPARISONS, "two", TWO)
    runs, out = tmp_path / "quick", tmp_path / "evaluations" / "quick"
    assert main(["train", "-m", *TINY, f"hydra.sweep.dir={runs}", "log.video_every=0", "log.figures_every=0"]) == 0
    grasps = ["trials=2", "kappas=1", "grasp.steps=4", "physics=fast"]
    assert main(["evaluate", f"policies=[{runs}/*,force_pi]", *grasps, f"out={out}"]) == 0
    page = tmp_path / "docs" / "page.md"
    (page.parent / "figures").mkdir(parents=True)
    page.write_text("\n".join(marks(compare_settings.writer("two"))))
    compare_settings.report("two", tmp_path, page.parent)
    assert (page.parent / "figures" / "two.png").stat().st_size > 1000
    found = json.loads((out / "evaluation.json").read_text())["policies"]
    overshoots = [figures["overshoot_percent"]["mean"] for name, figures in found.items() if name != "force_pi"]
    assert "| `experiment=quick` with | frames | s |" in page.read_text()
    assert re.search(r"^\| as it is \| 16 \| \d+ \| not reached \|", page.read_text(), re.MULTILINE)
    assert f"| {np.mean(overshoots):.1f} ± " in page.read_text()
    monkeypatch.setattr(compare_settings, "GOAL", -1000.0)
    assert re.search(r"\| 16 \| \d+ \| 16 \|", compare_settings.table(TWO, tmp_path))
    with pytest.raises(SystemExit, match="nothing is done"):
        compare_settings.report("two", tmp_path / "elsewhere", page.parent)
