"""The program that makes the figures of the pages: what it tells, goes on with, writes, and never writes."""

from __future__ import annotations

import json
import shutil

import pytest

from tools.measured_code import ROOT, digest
from tools.results import __main__ as program
from tools.results import blocks, execute, hours, pages, tables
from tools.results.hours import Rates
from tools.results.notes import Note, Notes, State
from tools.results.policies import MEASURED, POLICIES, REWARD, SWEEPS, Policy
from tools.results.seeds import best_seed
from tools.results.settings import CODE, Settings, digests
from tools.results.stage import Stage
from tools.results.stages import stages

FIRST = Stage("first", "something", (("python", "a"), ("python", "b")))
SECOND = Stage("second", "more of it", (("python", "c"),), needs=("first",))


@pytest.fixture
def ran(monkeypatch) -> list[str]:
    """Commands that were run, by their last word."""
    words: list[str] = []

    def run(command: list[str]) -> int:
        words.append(command[-1])
        return 0

    monkeypatch.setattr(execute, "run_command", run)
    return words


def told(chosen, notes, redo=False) -> tuple[int, list[str]]:
    said: list[str] = []
    return execute.carry_out(chosen, notes, redo, said.append), said


# Stages


def test_what_is_done_is_not_done_again(ran, tmp_path):
    assert told([FIRST, SECOND], Notes(tmp_path))[0] == 0
    assert ran == ["a", "b", "c"]
    assert told([FIRST, SECOND], Notes(tmp_path)) == (0, [])
    assert ran == ["a", "b", "c"]


@pytest.mark.parametrize("how", [execute.INTERRUPTED, -9, KeyboardInterrupt])
def test_a_stage_that_was_ended_goes_on_with_the_command_it_was_at(how, ran, monkeypatch, tmp_path):
    goes_well = execute.run_command

    def ends(command: list[str]) -> int:
        if command[-1] != "b":
            return goes_well(command)
        if isinstance(how, int):
            return how
        raise how

    monkeypatch.setattr(execute, "run_command", ends)
    status, said = told([FIRST, SECOND], Notes(tmp_path))
    assert status == (how if isinstance(how, int) else execute.INTERRUPTED)
    assert "goes on from here" in said[-1]
    assert Notes(tmp_path).state(FIRST)[0] is State.BEGUN
    monkeypatch.setattr(execute, "run_command", goes_well)
    assert told([FIRST, SECOND], Notes(tmp_path))[0] == 0
    assert ran == ["a", "b", "c"]


def test_a_command_runs_in_the_repository_and_its_status_counts(root, tmp_path):
    stage = Stage("s", "", (("python", "-c", "import sys, os; sys.exit(3 if os.path.isdir('forcegrasp') else 0)"),))
    status, said = told([stage], Notes(tmp_path))
    assert status == 3
    assert "failed (exit status 3)" in said[-1]


def test_what_is_outdated_is_told_and_redone_only_when_asked(ran, tmp_path, monkeypatch):
    told([FIRST, SECOND], Notes(tmp_path))
    (tmp_path / "first").mkdir()
    ran.clear()
    now = Notes(tmp_path)
    now._now = dict.fromkeys(CODE, "another")
    assert now.state(FIRST) == (State.OUTDATED, "with other code")
    status, said = told([FIRST, SECOND], now)
    assert status == 1
    assert said[0] == "first: made with other code, and left as it is; --redo outdated makes it anew"
    assert not ran
    assert told([FIRST, SECOND], now, redo=True)[0] == 0
    assert ran == ["a", "b", "c"]
    assert not (tmp_path / "first").exists()


def test_other_commands_and_a_need_made_anew_outdate_a_stage(ran, tmp_path):
    notes = Notes(tmp_path)
    told([FIRST, SECOND], notes)
    other = Stage("first", "something", (("python", "z"),))
    assert notes.state(other) == (State.OUTDATED, "by other commands")
    told([other], notes, redo=True)
    assert notes.state(SECOND) == (State.OUTDATED, "before first")


def test_a_stage_waits_for_what_it_needs(ran, tmp_path):
    status, said = told([SECOND], Notes(tmp_path))
    assert (status, said, ran) == (1, ["second: waits for first"], [])


# The list, and what is told before anything begins


@pytest.fixture(scope="module")
def every() -> dict[str, Stage]:
    return stages(Settings())


def test_each_policy_and_sweep_is_trained_and_evaluated_with_five_seeds(every):
    for name in [policy.name for policy in POLICIES] + list(SWEEPS):
        command = every[f"train-{name}"].commands[0]
        assert "seed=1,2,3,4,5" in command
        assert {"hydra/launcher=joblib", "physics.threads=1"} <= set(command)  # a core each
        assert every[f"evaluate-{name}"].needs[-1] == f"train-{name}"
    assert every["train-ib"].trained == 5 * 4_500_000
    assert [every[f"train-{sweep}"].trained // 22_500_000 for sweep in ("ablation", "parts", "printed")] == [1, 4, 3]
    assert all(need in every for stage in every.values() for need in stage.needs)
    assert all(name in every for block in blocks.BLOCKS for name in block.stages)


def test_what_a_policy_has_trained_stands_in_a_table_of_sweeps_without_a_training_of_its_own(every):
    softness, curves = every["evaluate-ablation"].commands
    assert every["evaluate-ablation"].needs == ("train-ib", "train-no_ib", "train-no_rand", "train-ablation")
    folders = [f"runs/results/{name}" for name in every["evaluate-ablation"].needs]
    assert f"policies=[{','.join(f'{folder}/*' for folder in folders)},force_pi]" in softness
    assert list(curves[2:-1]) == folders
    assert every["evaluate-ablation"].evaluated == 21 * 11 * 50 * 150


@pytest.mark.parametrize("policy", ["ib", "no_ib", "no_rand"])
def test_policies_beside_a_sweep_are_trained_as_its_own_runs_are(policy):
    from forcegrasp.cli.options import compose

    asked = next(one for one in POLICIES if one.name == policy).options.split()
    shared = [word for word in SWEEPS["ablation"].options.split() if not word.startswith("experiment=")]
    sweep = compose("train", [f"experiment={policy}", *shared])
    if policy == "ib":
        assert repr(compose("train", asked)) == repr(sweep)
    else:  # without the inductive bias nothing reads its φ
        assert repr(compose("train", [*asked, "action.bias_one_contact=0"])) == repr(sweep)


@pytest.mark.long
def test_trainings_and_evaluations_are_commands_that_there_are(every):
    from forcegrasp.cli.options import compose

    asked = [command for stage in every.values() for command in stage.commands if command[0] == "forcegrasp"]
    for _, verb, *words in (command for command in asked if command[1] in ("evaluate", "record", "diagnose", "curves")):
        plain = [word.replace("/*", "/run") for word in words if "=" in word]
        compose(verb, plain) if verb != "curves" else None


def test_plan_tells_states_and_hours_and_begins_nothing(ran, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(hours, "measure_rates", lambda say: Rates(25_000, 5_000))
    assert program.main(["plan", "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out.splitlines()
    assert "to do       0.2 h  train-ib: 5 seeds of ib" in said
    total = sum(float(line.split()[2]) for line in said if line.startswith("to do"))
    told_total = next(float(line.split()[1]) for line in said if line.startswith("about"))
    assert told_total == pytest.approx(total, abs=1)
    assert "left out: docs/real-data.md, without --real-data FOLDER" in said
    assert not ran
    assert not (tmp_path / "out").exists()


def test_hours_are_those_of_the_machine():
    stage = Stage("s", "", (), trained=7200, evaluated=3600, hours=1)
    assert Rates(1.0, 2.0).hours(stage) == pytest.approx(1 + 2 + 0.5)


def test_only_takes_what_is_needed_along_and_skip_leaves_out(every):
    def names(only: list[str], skip: list[str]) -> list[str]:
        return [stage.name for stage in program.choose(every, only, skip)]

    assert names(["ship-ib"], []) == ["train-ib", "evaluate-ib", "ship-ib"]
    assert names(["printed"], ["train-printed"]) == ["evaluate-printed"]
    assert set(every) - set(names([], ["grippers", "pages"])) == {"grippers"}
    assert [stage.name for stage in program.choose(every, ["pictures"], [], package=True)] == ["pictures"]
    with pytest.raises(ValueError, match="nothing is called ib, no_such; there are"):
        program.choose(every, ["ib"], ["no_such"])


def test_bad_input_is_one_line(capsys):
    assert program.main(["--only", "no_such"]) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)


# Pages


def evaluation(**means: float) -> dict:
    """As evaluation.json, every figure of a policy the same."""

    def figures(mean: float) -> dict:
        cells = [{"mean": mean, "std": 9.0}, {"mean": mean - 1, "std": 8.0}]
        one = {"mean": mean, "std": 8.5, "median": mean + 1, "p95": mean + 2, "by_cell": cells}
        beaten = {"improvement": {"probability": 0.5}}
        return {name: one | (beaten if name == REWARD else {}) for name in (*tables._ROWS, MEASURED)}

    policies = {name: figures(mean) for name, mean in means.items()}
    told = {"cells": ["0.0", "1.0"], "trials": 2, "what": "softness", "seed": 1000}
    return {**told, "policies": policies}


def on_robots(**means: float) -> dict:
    """As that of plan=robots: the test half stands in the table, against the baseline, by the forces that act."""

    def figures(mean: float) -> dict:
        halves = {"development": mean - 50, "test": mean}
        of = {half: {"mean": m, "low": m - 3, "high": m + 5, "lowest": m - 40} for half, m in halves.items()}
        return dict.fromkeys((*tables._ROWS, MEASURED), of)

    one = {"one": "catalogue", "other": "force_pi", "metric": REWARD, "half": "test"}
    one |= {"mean": 10.04, "low": 8.0, "high": 12.0, "worst": -15.2, "worst_robot": 3, "beyond_margin": 1}
    others = [one | {key: value, "mean": 99} for key, value in
              (("half", "development"), ("metric", MEASURED), ("other", "informed"))]  # fmt: skip
    halves = {"development": [0, 2], "test": [1, 3]}
    policies = {name: figures(mean) for name, mean in means.items()}
    return {"baseline": "force_pi", "halves": halves, "differences": [one, *others], "policies": policies}


@pytest.fixture
def results(tmp_path):
    """A folder of results: every stage ended, each policy with the rewards 100, 101 … of its seeds."""
    out, asked, code = tmp_path / "results", stages(Settings(out=tmp_path / "results")), digests()
    for stage in asked.values():
        note = Note([list(c) for c in stage.commands], dict.fromkeys(stage.needs, "now"), "c0ffee", code[stage.code])
        note.done, note.ended = len(note.commands), "now"
        Notes(out)._write(stage.name, note)

    def put(name: str, where: str, report: dict) -> None:
        folder = out / f"evaluate-{name}" / where
        folder.mkdir(parents=True)
        (folder / "evaluation.json").write_text(json.dumps(report))

    def put_run(folder: str, run: str, experiment: str, seed: int) -> None:
        path = out / folder / run
        path.mkdir(parents=True)
        command = ["forcegrasp", "train", f"experiment={experiment}"]
        (path / "run.json").write_text(json.dumps({"command": command, "seed": seed}))

    for where in ("softness", "objects", "robot", "development"):
        put("controllers", where, evaluation(force_pi=90, informed=120))
        for policy in POLICIES:
            put(policy.name, where, evaluation(**{f"r_s{k}_{k - 1}": 99 + k for k in (1, 2, 3, 4, 5)}, force_pi=90))
    (out / "robots" / "evaluation").mkdir(parents=True)
    (out / "robots" / "evaluation" / "evaluation.json").write_text(json.dumps(on_robots(catalogue=82.04, force_pi=72)))
    for policy in POLICIES:
        for k in (1, 2, 3, 4, 5):
            put_run(f"train-{policy.name}", f"r_s{k}_{k - 1}", "ib_tuned", k)
    for sweep, names in (("ablation", ["no_curriculum"]), ("parts", ["no_noise"]), ("printed", ["ib", "no_ib"])):
        runs = {f"{name}_s{k}_{k}": 100 + k for name in names for k in (1, 2)}
        beside = {"r_s1_0": 103, "r_s2_1": 104} if SWEEPS[sweep].beside else {}
        put(sweep, "softness", evaluation(**beside, **runs, force_pi=90))
        (out / f"evaluate-{sweep}" / "curves").mkdir()
        curves = {"groups": {name: {"runs": [{"frames": 4_500_480}]} for name in names}}
        (out / f"evaluate-{sweep}" / "curves" / "curves.json").write_text(json.dumps(curves))
        for run in runs:
            put_run(f"train-{sweep}", run, run.partition("_s")[0], int(run[-1]))
    return out


@pytest.fixture
def repository(root, tmp_path, monkeypatch):
    """A copy of the pages and cards, written to in the repository's place."""
    copy = tmp_path / "repository"
    for name in {block.page for block in blocks.BLOCKS}:
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(root / name, copy / name)
    for policy in POLICIES:
        card = f"forcegrasp/policies/{policy.name}/card.md"
        (copy / card).parent.mkdir(parents=True)
        shutil.copy(root / card, copy / card)
    monkeypatch.setattr(pages, "ROOT", copy)
    monkeypatch.setattr(Settings, "into", property(lambda self: self.out / "pages" if self.trial else copy))
    return copy


def texts(folder) -> dict[str, str]:
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*.md")}


def test_tables_are_replaced_and_nothing_else_of_a_page(results, repository, every):
    before = texts(repository)
    said: list[str] = []
    pages.write_pages(Settings(out=results), Notes(results), every, said.append)
    assert not said
    after = texts(repository)
    for name in {block.page for block in blocks.BLOCKS}:
        old, new = before[name], after[name]
        for block in (one for one in blocks.BLOCKS if one.page == name):
            mark = pages._marked(block.name)
            assert len(mark.findall(old)) == len(mark.findall(new)) == 1
            assert mark.search(old)[2] != mark.search(new)[2]
            old, new = mark.sub("", old), mark.sub("", new)
        assert old == new
    page = after["docs/results.md"]
    assert "| force reward, normalised form | 102.0 ± 2.0 | 102.0 ± 2.0 | 102.0 ± 2.0 | 90.0 |" in page
    assert "| crushed [% of the grasps] | 102.0 ± 2.0 | 102.0 ± 2.0 | 90.0 | 120.0 |" in page
    assert "| peak force [N] | 102.000 ± 1.963; 103.000; 104.000 |" in page
    assert "| κ | 0.0 | 1.0 |\n|---|---|---|\n| ib | 102.0 | 101.0 |" in page
    stamp = f"Measured with commit `c0ffee`, digest `{digests()['training']}`"
    assert f"{stamp}: `python -m tools.results --only paper`, 5 seeds." in page
    assert "![Object movement by softness](figures/paper_displacement.png)" in page
    ablations = after["docs/ablations.md"]
    assert "| `no_curriculum` | 101.5 ± 6.4 | 101.5 ± 6.4 | 101.500 ± 6.353 | 101.5 ± 6.4 | 101.0 102.0 |" in ablations
    assert "| `ib_tuned` | 103.5 ± 6.4 | 103.5 ± 6.4 | 103.500 ± 6.353 | 103.5 ± 6.4 | 103.0 104.0 |" in ablations
    assert "| hand-written (`force_pi`) | 90.0 | 90.0 | 90.000 | |" in ablations
    trained = f"`forcegrasp train -m {SWEEPS['ablation'].options}`, 2 seeds each, 4,500,480 frames; evaluated on"
    assert "`forcegrasp train -m experiment=ib_tuned`, `forcegrasp train -m experiment=no_ib" in ablations
    assert trained in ablations
    robot = "| `ib` | 102.0 ± 2.0 | 102.0 ± 2.0 | 102.0 ± 2.0 | 102.00 ± 1.96 | 109 ± 13; 1.7 ± 0.9 mm |"
    assert robot in after["docs/transfer.md"]
    assert "| `ib_virtual_robot_measured` | 102 ± 9 | 101 ± 8 | 102 ± 8 |" in after["docs/transfer.md"]
    robots = after["docs/robots.md"]
    assert "| catalogue | 82.0 ± 4.0 | 82.0 ± 4.0 | 82.04 | 82 | 82.0 | 82.0 | 42 |" in robots
    assert "| force_pi | 72.0 ± 4.0 |" in robots
    assert "| catalogue | +10.0 ± 2.0 | -15 (3) | 1 | +99.0 ± 2.0 | -15 (3) | 1 |" in robots
    assert "`python -m tools.results --only robots`, the policies of the package." in robots
    again = texts(repository)
    pages.write_pages(Settings(out=results), Notes(results), every, said.append)
    assert texts(repository) == again


def test_what_is_not_measured_stays_on_the_page(results, repository, every):
    before = texts(repository)
    (results / "notes" / "train-parts.json").unlink()
    said: list[str] = []
    pages.write_pages(Settings(out=results), Notes(results), every, said.append)
    assert said == ["docs/ablations.md, parts: stays as it is, without evaluate-parts"]
    said.clear()
    pages.write_pages(Settings(out=results), Notes(results), ["train-ib", "evaluate-ib"], said.append)
    assert not said
    mark = pages._marked("parts")
    assert mark.search(texts(repository)["docs/ablations.md"])[2] == mark.search(before["docs/ablations.md"])[2]


@pytest.mark.parametrize("few", [{"seeds": 2}, {"frames": 1000}, {"trials": 2}])
def test_figures_of_a_trial_never_come_into_the_repository(few, results, repository, every):
    settings, before = Settings(out=results, **few), texts(repository)
    pages.write_pages(settings, Notes(results), every, lambda text: None)
    assert texts(repository) == before
    assert "a TRIAL that says nothing." in (results / "pages" / "docs" / "results.md").read_text()
    everything = stages(settings)
    assert not any(stage.writes_docs for stage in everything.values())
    for command in (command for stage in everything.values() for command in stage.commands):
        assert not any(word == "." or word.startswith("docs") for word in command)
        assert command[0] == "forcegrasp" or str(results / "pages") in command


def test_what_a_trial_ships_is_not_what_comes_with_the_package(every):
    trial = stages(Settings(trials=2))["pictures"].commands[0]
    assert "policies=[ib,no_ib,no_rand,force_pi]" in every["pictures"].commands[0]
    assert any(word.startswith("policies=[runs/results/pages/forcegrasp/policies/ib,") for word in trial)


def test_check_has_a_line_for_each_table_and_card_of_other_code(results, repository, every, monkeypatch):
    with monkeypatch.context() as later:
        later.setattr(pages, "digests", lambda: {"training": "of tomorrow"})
        found = pages.check(repository)
    # a table may be of several commits, each with its line
    assert len({line.split(": ")[0] for line in found}) == len(blocks.BLOCKS) + len(POLICIES)
    assert not [line for line in found if "its marks are not on the page" in line]
    pages.write_pages(Settings(out=results), Notes(results), every, lambda text: None)
    assert all("card.md" in line for line in pages.check(repository))
    page = repository / "docs/quickstart.md"
    page.write_text(page.read_text().replace(digests()["training"], "another"))
    assert [
        line for line in pages.check(repository) if line.startswith("docs/quickstart.md, paper-pictures: Measured with")
    ]
    page.write_text("# no marks\n")
    assert "docs/quickstart.md, paper-pictures: its marks are not on the page." in pages.check(repository)


def test_the_check_says_how_to_skip_it(monkeypatch, capsys):
    monkeypatch.setattr(pages, "check", lambda: ["docs/results.md, paper: Measured with other code."])
    assert program.main(["check"]) == 1
    said = capsys.readouterr().out
    assert "docs/results.md, paper" in said
    assert "--skip results" in said
    monkeypatch.setattr(pages, "check", list)
    assert program.main(["check"]) == 0


def test_the_last_picture_of_a_video_is_that_of_the_page(tmp_path):
    from PIL import Image

    from tools.results.pictures import last_picture

    shades = [Image.new("L", (4, 4), shade) for shade in (0, 100, 200)]
    shades[0].save(tmp_path / "grasp.gif", save_all=True, append_images=shades[1:])
    last_picture(tmp_path / "grasp.gif", tmp_path / "docs" / "one.png")
    with Image.open(tmp_path / "docs" / "one.png") as picture:
        assert picture.getpixel((0, 0)) == (200, 200, 200)


# Seeds, and the code


def test_the_seed_with_the_best_median_is_shipped_and_its_card_says_why(results):
    run, why = best_seed(POLICIES[1], results)
    assert run.name == "r_s5_4"
    assert "Of 5 seeds it is seed 5, which has the best median force reward on grasps" in why
    assert "105.0, 104.0, 103.0, 102.0, 101.0" in why
    _, of_robot = best_seed(Policy("ib_virtual_robot", "", "", True, MEASURED), results)
    assert "best median force reward by measured forces" in of_robot


def test_mean_and_interval_over_seeds():
    assert tables.over_seeds([1.0, 2.0, 3.0], 2) == "2.00 ± 2.48"  # 4.303 / √3, Student's t of two degrees
    assert tables.over_seeds([0.5], 1, 1e3) == "500.0"


def test_each_package_that_figures_depend_on_is_there(root):
    for name in (name for packages in CODE.values() for name in packages):
        assert (root / "forcegrasp" / name).exists() or (root / name).is_dir()


def test_a_digest_is_of_single_files_and_of_presets_beside_the_package(tmp_path):
    for path in ("package/evaluate/grids.py", "package/evaluate/page.py", "conf/sweep/one.yaml"):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text("a = 1\n")

    def now() -> str:
        return digest(tmp_path / "package", ("evaluate/grids.py", "conf"))

    known = {now()}
    (tmp_path / "package/evaluate/page.py").write_text("a = 2\n")
    assert now() in known
    for path in ("package/evaluate/grids.py", "conf/sweep/one.yaml"):
        (tmp_path / path).write_text("a = 2\n")
        assert now() not in known
        known.add(now())


def test_a_policy_of_the_package_was_shipped_as_its_card_says(tmp_path):
    notes = Notes(tmp_path)
    note = notes.ended("ship-ib")
    assert note is not None
    card = (ROOT / "forcegrasp/policies/ib/card.md").read_text()
    assert f"commit `{note.commit}`, digest `{note.digest}`" in card
    assert notes.behind(["ship-ib"]) == [note]
    assert notes.ended("ship-nothing") is None
    assert notes.ended("train-ib") is None
