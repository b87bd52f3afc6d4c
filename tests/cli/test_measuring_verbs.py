"""From measurements to a better model, by the command line alone: record, fit, diagnose, add, compare."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import shlex
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from rich import box
from rich.table import Table

from forcegrasp.cli.main import main
from forcegrasp.cli.results import print_table
from forcegrasp.reports.next_step import train_command
from tests.one_fit import fit_each_set_once

#: What makes a diagnosis quick.
FEW = "effects=[force_bias,force_drift]"
TABLE_META = "format: forcegrasp-measurements/1\nkind: final_force\ngripper: tiago\nsource: a test\nlicense: none\n"


def run(folder: Path, *arguments: str) -> str:
    """Runs a verb in a folder; returns what it printed."""
    out = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out):
        assert main(list(arguments)) == 0
    return out.getvalue()


def shorten(folder: Path, seconds: float) -> None:
    """Keeps the first seconds of each grasp."""
    path = folder / "samples.csv"
    with open(path, newline="") as file:
        head, *rows = list(csv.reader(file))
    column = head.index("t_s")
    with open(path, "w", newline="") as file:
        csv.writer(file).writerows([head, *(row for row in rows if float(row[column]) < seconds)])


@pytest.fixture(scope="session")
def loop(tmp_path_factory) -> SimpleNamespace:
    """A set with a force bias hidden in it, and all that the verbs made of it. Don't change it."""
    folder = tmp_path_factory.mktemp("loop")
    printed = {}
    printed["record"] = run(folder, "record", "out=my_set", "grasps=6", "objects=1", "effects=[force_bias]")
    shorten(folder / "my_set", 2.8)
    with pytest.MonkeyPatch.context() as patch:
        fit_each_set_once(patch)
        printed["fit"] = run(folder, "fit", "data=my_set", "out=model.yaml")
        printed["diagnose"] = run(folder, "diagnose", "data=my_set", FEW, "out=diagnosis")
    suggested = shlex.split(printed["diagnose"].split("add it: forcegrasp ")[1].splitlines()[0])
    printed["add"] = run(folder, *(a for a in suggested if not a.startswith("out=")), "out=new/better.yaml")
    printed["compare"] = run(folder, "compare", "data=my_set", "model=new/better.yaml", "out=comparison")
    results = {
        verb: json.loads(next(folder.glob(pattern)).read_text())
        for verb, pattern in {
            "fit": "runs/fit_*/fit.json",
            "diagnose": "diagnosis/diagnosis.json",
            "add": "runs/add_*/add.json",
            "compare": "comparison/compare.json",
        }.items()
    }
    return SimpleNamespace(folder=folder, printed=printed, **results)


@pytest.fixture
def folder(loop, tmp_path, monkeypatch) -> Path:
    """A working folder with the set, its models, a table of final forces, and things that are neither."""
    for name in ("my_set", "model.yaml", "new/better.yaml"):
        source = loop.folder / name
        (shutil.copytree if source.is_dir() else shutil.copy)(source, tmp_path / source.name)
    (tmp_path / "file").write_text("text")
    (tmp_path / "table").mkdir()
    (tmp_path / "table" / "meta.yaml").write_text(TABLE_META)
    rows = [f"foam,{0.0002 * k:g},{0.06 * max(0, k - 1) + 0.001 * (-1) ** k:g}" for k in range(1, 11)]
    (tmp_path / "table" / "table.csv").write_text("\n".join(["object,delta_q_m,final_force_n", *rows]) + "\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_hidden_effect_is_found(loop):
    found = loop.diagnose
    assert (found["verdict"], found["effects"]) == ("effect", ["force_bias"])
    assert found["ranking"][0]["effect"] == "force_bias"
    assert found["ranking"][0]["parameters"] == pytest.approx({"left_n": 0.06, "right_n": 0.04}, rel=0.1)
    assert found["ranking"][0]["p_family"] <= 0.01
    assert found["error_before"] > 2 > 1.1 > found["error_after"] == found["floor_ratio"]
    assert "lacks force_bias" in loop.printed["diagnose"]
    assert "force_bias: without it the model misses force left by " in loop.printed["diagnose"]
    if found["next_grasp"]:
        assert f"record next: {found['next_grasp']['grasp']}" in loop.printed["diagnose"]


def test_the_error_falls_when_it_is_added(loop):
    assert loop.fit["converged"]
    assert loop.fit["error_heldout"] == pytest.approx(loop.add["error_before"], rel=0.02)
    assert loop.add["error_after"] < 0.5 * loop.add["error_before"]
    assert loop.compare["floor_ratio"] == pytest.approx(loop.add["error_after"], rel=0.02)
    assert "no failure" in loop.printed["compare"]


def test_a_law_of_a_file_is_added(folder, capsys):
    sizes = {"c": {"value": 0.05, "low": -1, "high": 1, "unit": "N"}}
    law = {"name": "offset", "place": "force", "expression": "c", "parameters": sizes}
    Path("law.yaml").write_text(yaml.safe_dump(law))
    assert main(["add", "my_set", "model=model.yaml", "effect=law.yaml", "out=with.yaml"]) == 0
    added = yaml.safe_load(Path("with.yaml").read_text())["effects"]["offset"]
    assert added["law"]["expression"] == "c"
    assert 0.04 < added["c"]["value"] < 0.06  # of the two biases the mean
    capsys.readouterr()
    assert main(["add", "my_set", "model=with.yaml", "effect=law.yaml", "out=new.yaml"]) == 2
    assert "has it already" in capsys.readouterr().err
    for text, problem in (("c * open(force)", "open: no such function"), ("c * nothing", "nothing: unknown")):
        Path("law.yaml").write_text(yaml.safe_dump(law | {"expression": text}))
        assert main(["add", "my_set", "model=model.yaml", "effect=law.yaml"]) == 2
        refusal = capsys.readouterr().err
        assert f"law.yaml: expression: {problem}" in refusal
        assert refusal.count("\n") == 1
    assert main(["add", "my_set", "model=model.yaml", "effect=missing.yaml"]) == 2
    assert "missing.yaml: could not read the law" in capsys.readouterr().err


def test_diagnose_writes_the_base_model_beside_the_report_and_suggests_it(loop):
    paths = (loop.folder / "diagnosis" / "base_model.yaml", loop.folder / "model.yaml")
    beside, fitted = (yaml.safe_load(path.read_text()) for path in paths)
    assert (beside["effects"], beside["data"]) == ({}, fitted["data"])
    assert beside["base"]["position_gain"]["value"] == pytest.approx(fitted["base"]["position_gain"]["value"], rel=1e-3)
    assert "add data=my_set model=diagnosis/base_model.yaml effect=force_bias" in loop.printed["diagnose"]
    assert "model=model.yaml" not in loop.printed["diagnose"]


def test_compare_writes_the_base_model_beside_the_report_and_suggests_it(folder, capsys, monkeypatch):
    from forcegrasp.identify import comparison
    from forcegrasp.models.model_file import read_model

    fitted, real = read_model(Path("model.yaml")), comparison.compare
    monkeypatch.setattr(comparison, "compare", lambda loaded, model, *rest: real(loaded, fitted, *rest))  # saves a fit
    monkeypatch.setattr("forcegrasp.reports.html._svg", lambda figure: "")  # the loop has drawn them
    assert main(["compare", "my_set", "out=where"]) == 0
    assert "diagnose data=my_set model=where/base_model.yaml" in capsys.readouterr().out
    beside = yaml.safe_load((folder / "where" / "base_model.yaml").read_text())
    assert {**beside, "mujoco": ""} == {**yaml.safe_load((folder / "model.yaml").read_text()), "mujoco": ""}
    assert main(["compare", "my_set", "model=better.yaml", "out=there"]) == 0
    assert not (folder / "there" / "base_model.yaml").exists()
    assert "base_model" not in capsys.readouterr().out


def test_a_comparison_that_leaves_nothing_to_do_writes_its_results_all_the_same(folder, capsys, monkeypatch):
    """As that of a servo whose model is at the floor, which nobody trains with."""
    monkeypatch.setattr("forcegrasp.reports.results.CompareResult.commands", lambda *_: [])
    monkeypatch.setattr("forcegrasp.reports.html._svg", lambda figure: "")  # the loop has drawn them
    assert main(["compare", "my_set", "model=better.yaml", "out=nothing_next"]) == 0
    assert "next:" not in capsys.readouterr().out
    assert (folder / "nothing_next" / "compare.json").exists()
    assert (folder / "nothing_next" / "report.html").exists()


@pytest.mark.parametrize("verb", ["compare", "diagnose", "add"])
@pytest.mark.parametrize("other", [True, False])
def test_a_model_of_other_measurements_is_used_with_a_warning(verb, other, folder, capsys, monkeypatch):
    from forcegrasp.diagnosis import add_effect, diagnose_set
    from forcegrasp.errors import ConfigError
    from forcegrasp.identify import comparison

    def stop(loaded, model, *_, **__):
        raise ConfigError(f"with {model.data['set']} and {len(loaded.warnings)} warnings")

    for home, name in ((comparison, "compare"), (diagnose_set, "diagnose_set"), (add_effect, "add_effect")):
        monkeypatch.setattr(home, name, stop)
    if other:
        text = (folder / "model.yaml").read_text()
        (folder / "model.yaml").write_text(text.replace("fingerprint: ", "fingerprint: 0").replace("my_set", "hers"))
    assert main([verb, "my_set", "model=model.yaml", *(["effect=backlash"] if verb == "add" else [])]) == 2
    captured = capsys.readouterr()
    warning = "warning: model=model.yaml: was fitted to other measurements (hers) than my_set\n"
    assert captured.out == (warning if other else "")
    assert captured.err == f"forcegrasp: with {'hers and 1' if other else 'my_set and 0'} warnings\n"


def test_noise_that_is_given_is_held_against_the_readings_before_anything_is_fitted(folder, capsys, monkeypatch):
    from forcegrasp.identify import fit_set

    meta = (folder / "my_set" / "meta.yaml").read_text()
    monkeypatch.setattr(fit_set, "make_target", None)  # nothing may be fitted
    for given, told in (
        ("13", "looks like millinewtons"),
        ("1.0e+300", "looks like"),
        ("0.2", "0.2 N is given, the readings show 0.01"),
    ):
        (folder / "my_set" / "meta.yaml").write_text(meta.replace("force_std_n: 0.013", f"force_std_n: {given}"))
        for verb in ("compare", "fit", "diagnose"):
            assert main([verb, "my_set"]) == 2
            captured = capsys.readouterr()
            assert captured.err.count("\n") == 1
            assert told in captured.err
            assert not captured.out


def test_models_are_text_with_intervals(loop):
    model = yaml.safe_load((loop.folder / "model.yaml").read_text())
    better = yaml.safe_load((loop.folder / "new" / "better.yaml").read_text())
    assert (model["effects"], list(better["effects"])) == ({}, ["force_bias"])
    bias = better["effects"]["force_bias"]["left_n"]
    assert bias["low"] < 0.06 < bias["high"]
    reported = loop.add["parameters"]["force_bias.left_n"]
    assert (reported.pop("unit"), bias.pop("unit")) == ("N", "N")
    assert reported == pytest.approx(bias, rel=1e-6)


def test_every_verb_writes_a_report_and_says_where(loop):
    for verb, place in (("diagnose", "diagnosis"), ("compare", "comparison")):
        assert (loop.folder / place / "report.html").stat().st_size > 20_000
        assert f"report: {place}/report.html" in loop.printed[verb]
    for verb, out in (("fit", "model.yaml"), ("add", "new/better.yaml")):
        (report,) = loop.folder.glob(f"runs/{verb}_*/report.html")
        assert f"report: {report.relative_to(loop.folder)}" in loop.printed[verb]
        assert f"wrote {out}" in loop.printed[verb]


def test_what_is_printed_is_short(loop):
    for printed in loop.printed.values():
        answer = [line for line in printed.splitlines() if not line.startswith("  [")]
        assert len(answer) < 40


def test_a_table_of_final_forces(folder, capsys):
    for verb, file in (("compare", "compare.json"), ("diagnose", "diagnosis.json")):
        assert main([verb, "data=table", f"out={verb}"]) == 0
        assert (folder / verb / "report.html").is_file()
        assert json.loads((folder / verb / file).read_text())["floor_ratio"] > 0
        assert "dead zone" in capsys.readouterr().out


def test_add_names_the_gripper_to_train_unless_it_is_the_default():
    assert train_command(Path("better.yaml"), "tiago") == "forcegrasp train model=better.yaml"
    other = "forcegrasp train model=better.yaml gripper=/lab/hand.yaml"
    assert train_command(Path("better.yaml"), "/lab/hand.yaml") == other


def test_an_effect_that_does_not_help_is_not_added(folder, capsys, monkeypatch):
    from forcegrasp.diagnosis import add_effect

    def useless(*arguments):
        return SimpleNamespace(error_before=1.0, error_after=0.996)

    monkeypatch.setattr(add_effect, "add_effect", useless)
    assert main(["add", "data=my_set", "model=model.yaml", "effect=backlash", "out=worse.yaml"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("forcegrasp: effect=backlash: the error on held-out grasps does not fall (1.000 ×")
    assert error.count("\n") == 1
    assert not (folder / "worse.yaml").exists()
    assert not (folder / "runs").exists()


MISTAKES = [
    *((verb, [], "data is missing: data=my_set") for verb in ("compare", "fit", "diagnose", "add")),
    *((verb, ["data=nowhere"], "nowhere") for verb in ("compare", "fit", "diagnose")),
    ("compare", ["data=file"], "file"),
    ("compare", ["data=my_set", "out=file"], "out=file: could not write"),
    ("compare", ["data=my_set", "out=file/below"], "is a file"),
    ("diagnose", ["data=my_set", "out=file"], "out=file: could not write"),
    ("compare", ["data=my_set", "model=file"], "forcegrasp-model/1"),
    ("compare", ["data=my_set", "model=nowhere.yaml"], "nowhere.yaml"),
    ("compare", ["data=my_set", "model=my_set"], "my_set: could not read the model"),
    ("diagnose", ["data=my_set", "model=file"], "forcegrasp-model/1"),
    ("diagnose", ["data=my_set", "effects=[backlsh]"], "effects=backlsh: no such effect; did you mean backlash"),
    ("diagnose", ["my_set", "effects=backlsh"], "effects=backlsh: no such effect; did you mean backlash"),
    *((verb, ["nowhere"], "nowhere: no such measurement set") for verb in ("compare", "fit", "diagnose")),
    *((verb, ["my_set", "data=table"], "only sets of one kind") for verb in ("compare", "fit", "diagnose")),
    ("add", ["my_set", "data=table", "model=model.yaml", "effect=backlash"], "only sets of one kind"),
    ("compare", ["my_set", "my_set"], "my_set: holds the same as my_set; give each set once"),
    ("compare", ["-q", "my_set"], "key=value"),
    ("add", ["my_set", "model=model.yaml", "effects=backlsh"], "did you mean backlash"),
    ("add", ["my_set", "model=model.yaml", "effects=[backlash,stiction]"], "one effect at a time"),
    ("add", ["my_set", "model=model.yaml", "effect=backlash", "effects=[stiction]"], "the same option"),
    ("fit", ["data=my_set", "out=my_set"], "it is a folder; name a file: out=my_set/model.yaml"),
    ("fit", ["data=my_set", "out=file/model.yaml"], "could not write"),
    ("add", ["data=my_set"], "model is missing: model=model.yaml"),
    ("add", ["data=my_set", "model=model.yaml"], "effect is missing: effect=backlash"),
    ("add", ["data=my_set", "model=model.yaml", "effect=backlsh"], "did you mean backlash"),
    ("add", ["data=my_set", "model=model.yaml", "effect=none"], "no such effect"),
    ("add", ["data=my_set", "model=file", "effect=backlash"], "forcegrasp-model/1"),
    ("add", ["data=my_set", "model=better.yaml", "effect=force_bias"], "has it already"),
    ("add", ["data=my_set", "model=model.yaml", "effect=backlash", "out=my_set"], "it is a folder"),
    ("fit", ["data=table"], "is a table of final forces"),
    ("add", ["data=table", "model=model.yaml", "effect=backlash"], "is a table of final forces"),
    ("compare", ["data=table", "model=model.yaml"], "leave model= out"),
    ("diagnose", ["data=table", "effects=[backlash]"], "leave effects= out"),
    ("compare", ["dta=my_set"], "did you mean data"),
]


@pytest.mark.parametrize(("verb", "arguments", "told"), MISTAKES, ids=[f"{v} {' '.join(a)}" for v, a, _ in MISTAKES])
def test_mistake(verb, arguments, told, folder, capsys):
    before = sorted(folder.rglob("*"))
    assert main([verb, *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("forcegrasp: ")
    assert captured.err.count("\n") == 1
    assert told in captured.err
    assert "Traceback" not in captured.err
    assert all(line.startswith("warning: ") for line in captured.out.splitlines())
    assert sorted(folder.rglob("*")) == before


@pytest.mark.parametrize("width", [120, 80, 40, 10])
def test_no_name_is_cut_off_in_a_table(width, capsys, monkeypatch):
    table = Table("", "effect", "gain", "error, × noise", "parameters", box=box.SIMPLE_HEAD)
    names = ["viscoelastic_contact", "force_gain_asymmetry"]
    for name in names:
        table.add_row("1", f"{name} standard", "+43927", "3.05 → 1.00", "time_constant_s 0.132 s, stiffness_share 0.1")
    monkeypatch.setenv("COLUMNS", str(width))
    print_table(table)
    printed = capsys.readouterr().out
    assert "…" not in printed
    for word in (*names, "standard", "parameters", "time_constant_s", "stiffness_share", "+43927"):
        assert word in printed
    if width >= 80:
        assert max(map(len, printed.splitlines())) <= width


def test_a_table_that_goes_to_a_file_has_a_page_to_itself(capsys, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    table = Table("parameters", box=box.SIMPLE_HEAD)
    table.add_row("word " * 22)
    print_table(table)
    assert 100 < max(map(len, capsys.readouterr().out.splitlines())) <= 120
