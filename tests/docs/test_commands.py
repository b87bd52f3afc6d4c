"""Every command line that the documentation shows is understood: the verb, its options, their values."""

from __future__ import annotations

import functools
import re
import shlex

import pytest
from doc_pages import PAGES, ROOT, blocks

from forcegrasp.cli.main import VERBS, main
from forcegrasp.cli.options import SCHEMAS, compose
from forcegrasp.cli.sweep import single_runs
from forcegrasp.controllers import CONTROLLERS
from forcegrasp.effects import get_effect
from forcegrasp.policies import shipped_policies
from forcegrasp.replay.record import parse_effect

#: Programs of other packages.
FOREIGN = {"pip", "git", "cd", "tensorboard", ".", "pre-commit", "ray", "export"}
#: What a reader of these pages has written before: an experiment, an effect.
WRITTEN = {"experiment=blind": "experiment=ib", "experiment=ib,blind": "experiment=ib,no_ib"}
OWN_EFFECTS = {"sensor_curvature"}


def lines() -> dict[str, str]:
    """Command line → the page that shows it, whether in a block or within a sentence."""
    found = {}
    for page, text in PAGES.items():
        shown = [line for block in blocks(page, "sh") for line in block.code.replace("\\\n", " ").splitlines()]
        shown += re.findall(r"`(forcegrasp [a-z]+ [^`\n]*)`", text)
        found |= {shlex.join(words): page for line in shown if (words := shlex.split(line, comments=True))}
    return {line: page for line, page in found.items() if not re.search(r"\b(VERB|NAME|YOUR_OPTION)\b|…", line)}


LINES = lines()
OURS = [line for line in LINES if line.startswith("forcegrasp ")]


@pytest.mark.parametrize("line", OURS, ids=[f"{LINES[line]}: {line[11:]}" for line in OURS])
def test_command_is_understood(line, monkeypatch, capsys):
    if "launcher=submitit" in line:
        pytest.importorskip("hydra_plugins.hydra_submitit_launcher")  # of the extra cluster
    _, verb, *words = shlex.split(line)
    words = [WRITTEN.get(word, word) for word in words]
    if verb not in SCHEMAS or "--help" in words:
        assert verb in VERBS
        assert main([verb, *words] if verb != "doctor" else ["doctor", "--help"]) == 0
    elif verb == "train":
        overrides = [word for word in words if word != "-m" and not word.startswith("resume=")]
        assert not (overrides and "resume=" in line)
        seen: set[str] = set()
        for run in single_runs(overrides) if "-m" in words else [overrides]:
            single = ["seed=1" if word.startswith("seed=") else word for word in run]  # one is understood as all are
            if not single or not seen.issuperset(single):  # each value of a sweep once
                composed("train", *single)
                seen.update(single)
    else:
        assert_names_are_known(understood(verb, words, monkeypatch))


@functools.cache  # sweeps have runs in common
def composed(verb: str, *overrides: str):
    return compose(verb, list(overrides))


def understood(verb: str, words: list[str], monkeypatch):
    """The configuration that the verb's own program makes of a command line, before it does anything."""
    made = []

    def stop(name: str, overrides: list[str]):
        made.append(composed(name, *overrides))
        raise KeyboardInterrupt

    monkeypatch.setattr("forcegrasp.cli.main.compose", stop)
    assert main([verb, *words]) == 130
    return made[0]


def assert_names_are_known(config) -> None:
    """Policies and effects that a command names are there, or a run of the reader's."""
    known = {*CONTROLLERS, *shipped_policies()}
    assert all("/" in name or name in known for name in getattr(config, "policies", []))
    for effect in getattr(config, "effects", []):
        assert effect.split()[0] in OWN_EFFECTS or parse_effect(effect)
    if getattr(config, "effect", ""):
        get_effect(config.effect)


def test_other_commands_are_there():
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
    for line, page in LINES.items():
        name, *words = shlex.split(line)
        if name == "make":
            assert set(words) <= set(targets), f"{page}: {line}"
        elif name == "python" and words[0] != "-m":
            assert (ROOT / words[0]).is_file(), f"{page}: {line}"
        elif name not in ("forcegrasp", "python"):
            assert name in FOREIGN or name.startswith(".venv/bin/"), f"{page}: {line}"


def test_experiments_that_the_reader_writes_are_shown():
    for word in WRITTEN:
        name = word.rpartition("=")[2].rpartition(",")[2]
        assert any(word in line for line in OURS)
        assert any(f"conf/experiment/{name}.yaml" in text for text in PAGES.values())
    for name in OWN_EFFECTS:
        assert any(f'name = "{name}"' in text for text in PAGES.values())
