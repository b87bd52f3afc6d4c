"""Shells complete what there is: the scripts hold it all, and bash, zsh and fish can use them."""

from __future__ import annotations

import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from forcegrasp.cli.completion import CONTROLLERS, FILES, SEVERAL, SHELLS, script, table
from forcegrasp.cli.main import VERBS, main
from forcegrasp.cli.options import SCHEMAS, groups, leaves
from forcegrasp.controllers import CONTROLLERS as KNOWN_CONTROLLERS
from forcegrasp.effects import catalogue
from forcegrasp.physics import shipped_grippers
from forcegrasp.policies import shipped_policies

#: What is typed, and what may then follow: the whole last word each, as far as its shell replaces it.
TYPED = {
    "forcegrasp tr": {"train"},
    "forcegrasp --v": {"--version"},
    "forcegrasp train exp": {"experiment="},
    "forcegrasp train seed=1 experiment=no_r": {"no_rand"},
    "forcegrasp train physics.tier=": {"reference", "fast"},
    "forcegrasp train hydra/l": {"hydra/launcher="},
    "forcegrasp train action.inductive_bias=t": {"true"},
    "forcegrasp effects backl": {"backlash", "backlash_asymmetry"},
    "forcegrasp completion ": {"--help", *SHELLS},
    "forcegrasp evaluate policies=no_i": {"no_ib"},
    "forcegrasp evaluate 'policies=[no_ib,for": {"policies=[no_ib,force_pi"},
    "forcegrasp evaluate 'policies=[runs/o": {"policies=[runs/one/"},
    "forcegrasp train resume=ru": {"runs/"},
    "forcegrasp compare data=my": {"my_set/"},
    "forcegrasp add effect=force_l": {"force_lag", "force_limit"},
    "forcegrasp fit zz": set(),
}


@pytest.fixture(scope="module")
def scripts(tmp_path_factory) -> dict[str, Path]:
    """Shell → its script, in a folder with a run and a measurement set."""
    folder = tmp_path_factory.mktemp("completion")
    (folder / "runs" / "one").mkdir(parents=True)
    (folder / "my_set").mkdir()
    for shell in SHELLS:
        (folder / f"script.{shell}").write_text(script(shell), "utf-8")
    return {shell: folder / f"script.{shell}" for shell in SHELLS}


def asked(command: list[str], folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_bash(scripts):
    """The function is called as readline would: every line in one process."""
    program = f"source {scripts['bash']}; compopt() {{ :; }}\n"
    for line in TYPED:
        words = line.replace("'", "").replace("=", " = ").split() + [""] * line.endswith((" ", "="))
        variables = f"COMP_LINE={shlex.quote(line)} COMP_POINT={len(line)} COMP_CWORD={len(words) - 1}"
        program += f"{variables} COMP_WORDS=({shlex.join(words)})\n"
        program += "_forcegrasp; printf '%s\\n' \"${COMPREPLY[@]}\"; echo ==\n"
    told = asked(["bash", "--norc", "-c", program], scripts["bash"].parent).split("==\n")[:-1]
    for (line, words), answer in zip(TYPED.items(), told, strict=True):
        assert set(answer.split()) == words, line


@pytest.mark.skipif(not shutil.which("fish"), reason="fish is not installed: its completion was not tried")
def test_fish(scripts):
    program = f"source {scripts['fish']}\n" + "\n".join(f'complete -C "{line}"; echo ==' for line in TYPED)
    told = asked(["fish", "--no-config", "-c", program], scripts["fish"].parent).split("==\n")[:-1]
    for (line, words), answer in zip(TYPED.items(), told, strict=True):
        offered = {row.partition("\t")[0] for row in answer.splitlines()}
        key = line.rpartition(" ")[2].partition("=")[0] + "=" if "=" in line.rpartition(" ")[2] else ""
        assert offered == {word if word.startswith(key.strip("'")) else key + word for word in words}, line


@pytest.mark.skipif(not shutil.which("zsh"), reason="zsh is not installed: its completion was not tried")
def test_zsh(scripts):
    asked(["zsh", "-n", str(scripts["zsh"])], scripts["zsh"].parent)


def test_table_holds_every_verb_option_and_preset():
    rows = {(verb, key): values for verb, key, *values in table()}
    assert {verb for verb, _ in rows} == set(VERBS)
    for verb, schema in SCHEMAS.items():
        for name, entry, _ in leaves(schema):
            assert set(entry.metadata["choices"]) <= set(rows[verb, name])
            assert (SEVERAL in rows[verb, name]) == str(entry.type).startswith("list")
        for group, choices in groups(verb).items():
            assert rows[verb, group] == choices
    assert set(rows["diagnose", "effects"]) == {*catalogue(), SEVERAL}
    assert set(rows["effects", "-"]) == {*catalogue(), "--help"}
    assert {*shipped_policies(), *KNOWN_CONTROLLERS, FILES} <= set(rows["evaluate", "policies"])
    assert sorted(CONTROLLERS) == sorted(KNOWN_CONTROLLERS)
    assert rows["record", "gripper"] == rows["effects", "gripper"] == [*shipped_grippers(), FILES]
    assert rows["record", "objects"] == []


@pytest.mark.parametrize("shell", SHELLS)
def test_script_is_printed(shell, capsys):
    """No word of it starts Python: a completion takes as long as the shell does."""
    assert main(["completion", shell]) == 0
    out = capsys.readouterr().out
    assert out == script(shell)
    assert all(" ".join(row) in out for row in table())
    assert not {"python", "@TABLE@", "@VERBS@"} & set(out.split())
    assert "$(forcegrasp" not in out


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "which shell?"),
        (["bash", "zsh"], "which shell?"),
        (["bsh"], "did you mean bash"),
        (["powershell"], "known: bash"),
    ],
)
def test_mistakes(arguments, told, capsys):
    assert main(["completion", *arguments]) == 2
    out, err = capsys.readouterr()
    assert not out
    assert told in err
    assert err.count("\n") == 1
