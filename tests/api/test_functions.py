"""``import forcegrasp as fg``: every function does what the verb of its name does, and says it in Python's way."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import json
import re
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import pytest
from matplotlib.figure import Figure

import forcegrasp as fg
from forcegrasp.api import CompareResult, TableResult
from forcegrasp.cli.main import main
from forcegrasp.diagnosis import add_effect, diagnose_set
from forcegrasp.diagnosis.cut_short import INTERRUPTED
from forcegrasp.effects import get_effect
from forcegrasp.effects.for_gripper import effects_of
from forcegrasp.errors import ConfigError, MeasurementError
from forcegrasp.models.model_file import Model, read_model, write_model
from forcegrasp.physics.gripper_file import load_gripper

#: Verb → how the same is had in Python, with a model that lies in model.yaml.
CALLS = {
    "compare": lambda: fg.compare("my_set"),
    "fit": lambda: fg.fit("my_set"),
    "diagnose effects=[backlash,force_lag]": lambda: fg.diagnose("my_set", effects=["backlash", "force_lag"]),
    "add model=model.yaml effect=force_bias": lambda: fg.add("my_set", "model.yaml", "force_bias"),
}


@pytest.fixture
def model(work) -> Path:
    """A model in the working folder."""
    write_model(work.made_up.model, "model.yaml")
    return Path("model.yaml")


@pytest.fixture(autouse=True)
def no_drawing(monkeypatch) -> None:
    """Drawings take time, and their names are numbered through a session."""
    monkeypatch.setattr(Figure, "savefig", lambda figure, file, **_: file.write("<svg/>"))


def parts(folder: Path) -> tuple[str, dict]:
    """Text of the report, and the figures, but for paths to type."""
    (file,) = folder.glob("*.json")
    return re.sub(r"<code>(forcegrasp \w+) .*</code>", r"\1", (folder / "report.html").read_text("utf-8")), {
        **json.loads(file.read_text("utf-8")),
        "model": "",
    }


@pytest.mark.parametrize("line", CALLS)
def test_report_is_the_verbs(line, model):
    verb, *options = line.split()
    target = "made.yaml" if verb in ("fit", "add") else "by_verb"
    assert main([verb, "data=my_set", *options, f"out={target}"]) == 0
    by_verb = Path("by_verb") if target == "by_verb" else next(Path("runs").glob(f"{verb}_*"))
    path = fg.report(CALLS[line](), "by_function")
    assert path == Path("by_function/report.html")
    assert parts(by_verb) == parts(path.parent)
    assert "<svg/>" in parts(path.parent)[0]


@pytest.mark.parametrize("verb", ["compare", "diagnose"])
def test_report_of_a_table_is_the_verbs(verb, table):
    assert main([verb, f"data={table}", f"out={table.parent / 'by_verb'}"]) == 0
    result = getattr(fg, verb)(str(table))
    assert isinstance(result, TableResult)
    assert parts(table.parent / "by_verb") == parts(fg.report(result, str(table.parent / "by_function")).parent)
    assert not (table.parent / "by_function" / "model.yaml").exists()
    assert "force_deadzone" in result.effects
    assert result.verdict == "one_of"


def test_report_lies_where_the_verb_would_put_it_and_holds_the_models(work, model):
    path = fg.report(fg.diagnose("my_set"))
    assert re.fullmatch(r"runs/diagnose_[-\d]+_[-\d]+/report\.html", str(path))
    (effect,) = read_model(path.parent / "model.yaml").effects
    assert effect.effect.name == "force_bias"
    assert not read_model(path.parent / "base_model.yaml").effects
    unknown = dataclasses.replace(fg.diagnose("my_set", model), diagnosis=work.made_up.diagnosis("unknown"))
    assert unknown.box(Path("o")).commands[0].line.endswith(" model=model.yaml")
    given, fitted = fg.compare("my_set", model), fg.compare("my_set")
    made = [list(result.models()) for result in (fitted, given, fg.diagnose("my_set", model), unknown)]
    assert made == [["base_model.yaml"], [], ["model.yaml"], []]
    assert not unknown.model.effects
    assert given.to_dict()["model"] == "model.yaml"
    again = fg.compare("my_set", given)
    assert again.to_dict()["model"] == repr(given)
    # what lies nowhere has no name to type
    assert again.box(Path("o")).commands[0].line.endswith(" model=FILE")
    assert fitted.box(Path("o")).commands[0].line.endswith(" model=o/base_model.yaml")


@pytest.mark.parametrize(("kind", "call"), [("fit_model", fg.fit), ("diagnose_set", fg.diagnose)])
def test_seed_is_passed_on_and_checked(kind, call, work):
    call("my_set", seed=7)
    assert 7 in work.calls[kind]
    with pytest.raises(ConfigError, match="seed=-1: must"):
        call("my_set", seed=-1)


def test_minutes_limit_a_diagnosis_and_are_checked(work, monkeypatch):
    limits = []
    monkeypatch.setattr("forcegrasp.api.functions.time_limit", lambda m: limits.append(m) or nullcontext())
    fg.diagnose("my_set", minutes=5)
    fg.diagnose("my_set")
    assert limits == [5, 0]
    with pytest.raises(ConfigError, match="minutes=-1: must"):
        fg.diagnose("my_set", minutes=-1)


@pytest.mark.parametrize(("stopped", "status"), [("", 0), ("its 3 min were over", 0), (INTERRUPTED, 130)])
def test_only_a_diagnosis_that_was_interrupted_has_another_exit_status(work, monkeypatch, stopped, status):
    found = dataclasses.replace(work.made_up.diagnosis("effect"), stopped=stopped)
    monkeypatch.setattr(diagnose_set, "diagnose_set", lambda *_, **__: (found, None))
    assert fg.diagnose("my_set").stopped == stopped
    assert main(["diagnose", "my_set", "out=there"]) == status
    assert json.loads(Path("there/diagnosis.json").read_text())["stopped"] == stopped


def test_effects_may_be_one_name_some_or_all(work):
    everything = list(effects_of(load_gripper("tiago")))
    for given, names in (("backlash", ["backlash"]), (["force_lag"], ["force_lag"]), ((), everything)):
        found = fg.diagnose("my_set", effects=given)
        assert work.calls["diagnose_set"][2] == names
        assert [effect.name for effect in found.tried] == names
    assert "Only" not in found.answer
    assert fg.diagnose("my_set", effects="force_lag").answer.endswith(" Only force_lag were tried.")


def test_a_model_may_be_a_file_a_model_or_a_result(work, model):
    known = read_model(model)
    data = fg.load("my_set")
    for given in (model, str(model), known, fg.fit(data), fg.diagnose(data), fg.add(data, known, "force_bias")):
        fg.compare(data, given)
        used = work.calls["compare"][1]
        assert isinstance(used, Model)
        if given is not known:
            expected = given.model if hasattr(given, "model") else known
            assert used.base == expected.base
    with pytest.raises(ConfigError, match="model: 3 is none; give what fit, diagnose or add returned, or a file"):
        fg.compare(data, 3)


@pytest.mark.parametrize("verb", ["compare", "diagnose", "add"])
def test_a_model_of_another_set_is_told(verb, work, model, capsys):
    data = {"set": "hers", "fingerprint": "of other grasps"}
    write_model(dataclasses.replace(read_model(model), data=data), model)
    more = ("force_bias",) if verb == "add" else ()
    result = getattr(fg, verb)("my_set", model, *more, progress=print)
    assert "was fitted to other measurements" in capsys.readouterr().out
    assert "was fitted to other measurements" in result.data.warnings[-1]


@pytest.mark.parametrize("kind", [str, Path])
def test_models_are_written_where_it_is_said(kind, work, model):
    made = {name: kind(f"new/{name}.yaml") for name in ("fit", "add")}
    results = fg.fit("my_set", out=made["fit"]), fg.add("my_set", model, "force_bias", out=made["add"])
    for result, path in zip(results, made.values(), strict=True):
        assert result.to_dict()["model"] == str(path)
        assert read_model(path).base.keys() == result.model.base.keys()
    assert fg.fit("my_set").path is None


def test_progress_is_told_if_it_is_asked_for(work, capsys):
    told: list[str] = []
    fg.compare("my_set", progress=told.append)
    work.calls["compare"][3]("further")
    assert told == [f"warning: {work.made_up.loaded.warnings[0]}", "further"]
    fg.compare("my_set")
    work.calls["compare"][3]("nothing of this")
    assert capsys.readouterr() == ("", "")


def test_results_say_what_was_found(work, model):
    found = fg.diagnose("my_set")
    assert (found.verdict, found.effects) == ("effect", ("force_bias",))
    assert found.error_after < 1.1 < 1.3 < found.error_before
    assert "lacks force_bias" in found.answer
    where = fg.compare("my_set")
    assert isinstance(where, CompareResult)
    assert (where.error, where.floor) == (where.comparison.floor_ratio(), 1.02)
    fitted = fg.fit("my_set")
    assert fitted.converged
    assert fitted.error == pytest.approx(fitted.to_dict()["error_heldout"])
    better = fg.add("my_set", fitted, "force_bias")
    assert better.error_after < better.error_before
    assert better.effect is get_effect("force_bias")


MISTAKES = [
    (lambda: fg.load("nowhere"), MeasurementError, "nowhere: no such measurement set"),
    (lambda: fg.compare("my_set", "nowhere.yaml"), ConfigError, "nowhere.yaml: could not read the model"),
    (lambda: fg.diagnose("my_set", effects="backlsh"), ConfigError, "effects=backlsh: no such effect; did you mean"),
    (lambda: fg.add("my_set", "model.yaml", "backlsh"), ConfigError, "effect=backlsh: no such effect; did you mean"),
    (lambda: fg.fit("my_set", out="."), ConfigError, "it is a folder; name a file"),
    (lambda: fg.add("my_set", "model.yaml", "force_bias", out="model.yaml/x"), ConfigError, "could not write"),
    (lambda: fg.report(fg.fit("my_set"), "model.yaml"), ConfigError, "out=model.yaml: could not write"),
    (lambda: fg.fit("table"), ConfigError, "is a table of final forces"),
    (lambda: fg.add("table", "model.yaml", "force_bias"), ConfigError, "is a table of final forces"),
    (lambda: fg.compare("table", "model.yaml"), ConfigError, "leave model= out"),
    (lambda: fg.diagnose("table", effects="backlash"), ConfigError, "leave effects= out"),
    (lambda: fg.compare("my_set", fg.compare("table")), ConfigError, "model: TableResult"),
]


@pytest.mark.parametrize(("call", "error", "told"), MISTAKES, ids=[told for *_, told in MISTAKES])
def test_mistakes_are_the_verbs(call, error, told, model, table):
    before = sorted(Path().rglob("*"))
    with pytest.raises(error) as caught:
        call()
    assert isinstance(caught.value, fg.ForcegraspError)
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)
    assert sorted(Path().rglob("*")) == before


def test_an_effect_that_does_not_help_is_not_added(work, model, monkeypatch):
    added = dataclasses.replace(work.made_up.added, error_before=1.0, error_after=0.996)
    monkeypatch.setattr(add_effect, "add_effect", lambda *_: added)
    with pytest.raises(ConfigError, match=r"force_bias: the error on held-out grasps does not fall \(1\.000 ×"):
        fg.add("my_set", model, "force_bias", out="worse.yaml")
    assert not Path("worse.yaml").exists()


LIGHT = """
import sys
import forcegrasp as fg
heavy = {"torch", "mujoco", "scipy", "matplotlib", "polars", "hydra"}
assert not heavy & set(sys.modules), heavy & set(sys.modules)
assert set(fg.__all__) <= set(dir(fg))
try:
    fg.load("nowhere")
except fg.ForcegraspError:
    pass
fg.compare, fg.fit, fg.diagnose, fg.add, fg.report
assert "torch" not in sys.modules
"""


def test_nothing_is_loaded_before_it_is_used():
    subprocess.run([sys.executable, "-c", LIGHT], check=True)


def test_editors_know_every_name(root):
    tree = ast.parse((root / "forcegrasp" / "__init__.py").read_text("utf-8"))
    typed = next(n for n in tree.body if isinstance(n, ast.If) and isinstance(n.test, ast.Name))
    known = [alias.name for node in typed.body if isinstance(node, ast.ImportFrom) for alias in node.names]
    assert sorted(known) == sorted(set(fg.__all__) - {"ForcegraspError"})


def test_a_verb_is_a_function_whatever_was_imported(work):
    assert isinstance(fg.compare("my_set"), CompareResult)
    assert list(inspect.signature(fg.compare).parameters) == ["data", "model", "seed", "progress"]


def test_other_names_are_not_there():
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'"):
        _ = fg.nonsense
