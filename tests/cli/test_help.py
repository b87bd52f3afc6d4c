"""Help comes up at once, and names everything there is."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from forcegrasp import __version__
from forcegrasp.cli.help import COMMON
from forcegrasp.cli.main import VERBS, main
from forcegrasp.cli.options import SCHEMAS, groups, leaves
from forcegrasp.config import is_left_out


def printed(capsys, *arguments: str) -> str:
    assert main(list(arguments)) == 0
    captured = capsys.readouterr()
    assert not captured.err
    return captured.out


@pytest.mark.parametrize("flag", ["--help", "-h", "help"])
def test_help_names_every_verb(capsys, flag):
    out = printed(capsys, flag)
    for name, verb in VERBS.items():
        assert verb.name == name
        assert re.search(rf"^ +{name} +{re.escape(verb.purpose)}$", out, re.MULTILINE)


def test_no_verb_shows_the_same_help_and_fails(capsys):
    help_text = printed(capsys, "--help")
    assert main([]) == 2
    assert help_text in "".join(capsys.readouterr())


def test_version(capsys):
    assert printed(capsys, "--version").strip() == __version__


def test_every_verb_has_help(capsys):
    assert set(SCHEMAS) <= set(VERBS)
    for verb in VERBS:
        first, empty, usage = printed(capsys, verb, "--help").splitlines()[:3]
        assert (first.startswith(f"forcegrasp {verb}: "), empty) == (True, "")
        assert usage.startswith(f"usage: forcegrasp {verb} [")


@pytest.mark.parametrize("arguments", [["--help", "--all"], ["--all"], ["seed=1", "--all", "-h"]])
@pytest.mark.parametrize("verb", SCHEMAS)
def test_all_of_the_help_names_every_option_and_preset(capsys, verb, arguments):
    out = printed(capsys, verb, *arguments)
    for name, entry, default in leaves(SCHEMAS[verb]):
        left = entry.metadata["of_gripper"] and is_left_out(default)
        line = f"  {name}={'(of gripper)' if left else str(default).replace(' ', '').replace(chr(39), '')}\n"
        assert line in out
        text = out.partition(line)[2].partition("\n")[0]
        assert entry.metadata["doc"] in text
        assert f"[{entry.metadata['unit']}]" in text or not entry.metadata["unit"]
        assert entry.metadata["source"] in text
        assert all(choice in out for choice in entry.metadata["choices"])
    for group, choices in groups(verb).items():
        assert f"  {group}={'|'.join(choices)}\n" in out


@pytest.mark.parametrize("verb", SCHEMAS)
def test_help_of_a_verb_fits_a_screen_and_says_where_the_rest_is(capsys, verb):
    out = printed(capsys, verb, "--help")
    assert len(out.splitlines()) <= 40
    names = [name for name, _, _ in leaves(SCHEMAS[verb])]
    shown = [name for name in names if re.search(rf"^  {re.escape(name)}=", out, re.MULTILINE)]
    assert {name for name in names if "." not in name or name in COMMON} == set(shown)
    left = re.search(r"^(\d+) more of [a-z, ]+:\n  forcegrasp (\w+) --help --all$", out, re.MULTILINE)
    assert (left.groups() if left else ("0", verb)) == (str(len(names) - len(shown)), verb)
    assert all(f"  {group}={'|'.join(choices)}\n" in out for group, choices in groups(verb).items())


def test_common_options_are_options():
    assert set(COMMON) <= {name for schema in SCHEMAS.values() for name, _, _ in leaves(schema)}


def test_help_of_train_explains_what_is_no_option(capsys):
    out = printed(capsys, "train", "--help")
    for word in ("resume=", "--multirun", "hydra.run.dir=", "hydra/launcher=joblib"):
        assert word in out


def test_help_is_quick():
    """Because nothing heavy is imported for it: no verb's, all in one process, takes long or brings such a module."""
    program = (
        "import sys; from time import perf_counter as now; started = now();"
        "from forcegrasp.cli.main import VERBS, main;"
        "heavy = {'torch', 'torchrl', 'mujoco', 'matplotlib', 'scipy', 'hydra'};\n"
        "for words in [['--help'], *([verb, '--help'] for verb in VERBS)]:\n"
        "    assert main(words) == 0\n"
        "    assert not heavy & set(sys.modules), words\n"
        "    print(now() - started, file=sys.stderr)"
    )
    told = []
    for _ in range(3):  # the machine may be busy with something else
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        told.append([float(line) for line in done.stderr.splitlines()])
        if max(told[-1]) < 1:
            break
    assert len(told[-1]) == 1 + len(VERBS)
    assert min(map(max, told)) < 1
