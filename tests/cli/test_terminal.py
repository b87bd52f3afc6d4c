"""Terminals that know no UTF-8, names that no line can hold: all is printed, or refused in one line."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from forcegrasp.cli.main import VERBS, main
from forcegrasp.cli.terminal import in_a_line, in_ascii

LOCALES = {
    "ascii": {"PYTHONIOENCODING": "ascii"},
    "latin-1": {"PYTHONIOENCODING": "latin-1"},
    "C": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
}


def run(lines: list[list[str]], surroundings: dict[str, str], cwd) -> bytes:
    """What command lines print, in one process, as each takes a while to start."""
    program = f"import sys; from forcegrasp.cli.main import main; sys.exit(any([main(words) for words in {lines}]))"
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, env={**os.environ, **surroundings}, cwd=cwd, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    return done.stdout


@pytest.mark.parametrize("name", LOCALES)
def test_everything_is_printed(name, tmp_path):
    helps = [[verb, "--help", "--all"] for verb in VERBS]
    printed = run([*helps, ["effects"]], LOCALES[name], tmp_path)
    told = printed.decode("latin-1" if name == "latin-1" else "ascii")
    assert "?" not in told.replace("without one?", "")
    assert "sigma_f [N]" in told
    assert "tau" in told


@pytest.mark.long
def test_files_are_written_whatever_the_locale_and_the_setting_of_mujocos_renderer(tiny, tmp_path):
    """Training renders in a process of its own, if at all."""
    lines = [
        ["train", *tiny["train"], "hydra.run.dir=run"],
        ["evaluate", *tiny["evaluate"], "policies=[run]", "out=out"],
    ]
    printed = run(lines, LOCALES["C"] | {"MUJOCO_GL": "nonsense"}, tmp_path)
    assert b"2 sigma_f of it" in printed
    assert "softness κ" in (tmp_path / "out" / "tables.md").read_text("utf-8")


def test_signs_in_ascii():
    assert [in_ascii(sign) for sign in "κΔλ₂²½éµ→"] == ["kappa", "Delta", "lambda", "2", "2", "1/2", "e", "u", "->"]
    assert [in_ascii(sign) for sign in "\udcff漢\u0302"] == ["\\udcff", "?", ""]


@pytest.mark.parametrize("name", ["a\nb", "a\rb", "a\x1b[31mb", "a\u2028b", "a\udcffb"], ids=ascii)
@pytest.mark.parametrize("words", [["train", "hydra.run.dir='{}'"], ["train", "resume={}"], ["curves", "{}"]])
def test_name_that_no_line_can_hold(name, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main([word.format(name) for word in words]) == 2
    out, err = capsys.readouterr()
    assert not out
    assert err.count("\n") == 1
    assert "rename what it names" in err
    assert not list(tmp_path.iterdir())


def test_names_of_other_languages_are_taken(tiny, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["train", *tiny["train"], "hydra.run.dir='größe 漢\u3000字 🙂'"]) == 0
    assert main(["train", "resume=größe 漢\u3000字 🙂"]) == 0
    assert "größe 漢\u3000字 🙂: already trained" in capsys.readouterr().out


def test_error_of_a_file_whose_name_has_a_line_break_is_one_line(finished, tmp_path, monkeypatch, capsys):
    (tmp_path / "seed\n0").mkdir()
    (tmp_path / "seed\n0" / "config.yaml").write_text("- no options")
    (tmp_path / "seed\n0" / "metrics.csv").write_text("frames\n")
    monkeypatch.chdir(tmp_path)
    assert main(["curves", "."]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert in_a_line("seed\n0") in err


@pytest.mark.parametrize("turn", "\u202e\u202b\u2067\u2066")
def test_nothing_turns_the_direction_of_a_message(turn):
    assert in_a_line(f"a{turn}b ا é") == f"a\\u{ord(turn):04x}b ا é"
