"""``forcegrasp effects`` tells all there is to know, and is quick."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.cli.main import main
from forcegrasp.effects import STAGES, catalogue, get_effect
from forcegrasp.effects.for_gripper import effects_of, why_left_out
from forcegrasp.physics import load_gripper, shipped_grippers


def printed(capsys, *arguments: str) -> str:
    assert main(["effects", *arguments]) == 0
    captured = capsys.readouterr()
    assert not captured.err
    assert max(map(len, captured.out.splitlines())) <= 120
    return captured.out


def words(text: str) -> str:
    """Text without its line breaks."""
    return " ".join(text.split())


def test_the_list_has_every_effect_under_its_stage(capsys):
    out = printed(capsys)
    heads = [line for line in out.splitlines() if line in STAGES]
    assert heads == list(STAGES)
    for effect in catalogue().values():
        part = out.partition(f"\n  {effect.name}\n")[2].partition("\n\n")[0]
        assert f"{effect.family}: {words(effect.symptom)}" in words(part)
        above = out.partition(f"\n  {effect.name}\n")[0].splitlines()
        assert [line for line in above if line in STAGES][-1] == effect.stage
        for p in effect.parameters:
            line = next(line for line in part.splitlines() if line.split()[0] == p.name)
            unit = "" if p.unit == "1" else f" {p.unit}"
            assert f" {p.doc}: {p.low:g} to {p.high:g}{unit}, typical {p.typical:g}" in line


@pytest.mark.parametrize("name", [*catalogue(), "none"])
def test_one_in_full(capsys, name):
    effect, out = get_effect(name), words(printed(capsys, name))
    assert out.startswith(f"{name}: {effect.__doc__.splitlines()[0]} ")
    for text in (effect.stage, effect.family, effect.symptom, effect.formula, effect.source, effect.separates):
        assert words(text) in out
    assert all(word in out for word in (*effect.variants, *effect.look_alikes, *(n.effect for n in effect.contains)))
    for p in effect.parameters:
        assert f"{p.name} {p.doc}: {p.low:g} to {p.high:g}" in out


@pytest.mark.parametrize("name", shipped_grippers())
def test_as_a_gripper_has_them(name, capsys):
    gripper = load_gripper(name)
    known, out = effects_of(gripper), printed(capsys, f"gripper={name}")
    assert re.findall(r"^  (\w+)$", out, re.MULTILINE) == [
        e.name for s in STAGES for e in known.values() if e.stage == s
    ]
    for effect in known.values():
        part = words(out.partition(f"\n  {effect.name}\n")[2].partition("\n\n")[0])
        for p in effect.parameters:
            unit = "" if p.unit == "1" else f" {p.unit}"
            assert f"{p.name} {p.doc}: {p.low:g} to {p.high:g}{unit}, typical {p.typical:g}" in part
    told = words(out).partition(" Left out: ")[2]
    for effect in catalogue().values():
        why = why_left_out(effect, gripper)
        assert bool(why) == (effect.name not in known) == (effect.name in re.findall(r"\w+", told))
        assert why in told
    assert ("force readings" in told) == (len(gripper.forces) < 2)


def test_of_the_default_gripper_they_are_the_catalogue(capsys):
    listed = printed(capsys, f"gripper={DEFAULT_GRIPPER}").partition("Left out")[0]
    everything = printed(capsys)
    assert all(line in everything for line in listed.splitlines())


def test_one_as_a_gripper_has_it(capsys):
    (parameter,) = effects_of(load_gripper("so101_gripper"))["backlash"].parameters
    out = words(printed(capsys, "gripper=so101_gripper", "backlash"))
    assert f"{parameter.name} {parameter.doc}: {parameter.low:g} to {parameter.high:g} rad" in out


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["backlash", "gripper=franka_hnd"], "gripper=franka_hnd: no such gripper"),
        (["backlash", "griper=tiago"], "no option 'griper'; did you mean gripper?"),
        (["gripper=tiago", "gripper=so101_gripper"], "effects: one gripper at a time, not 'tiago so101_gripper'"),
        (["gripper=so101_gripper", "force_crosstalk"], "effect force_crosstalk: needs 2 force readings"),
        (["gripper=so101_jaw", "adhesion"], "effect adhesion: is one of grasped objects; so101_jaw grasps nothing"),
        (["gripper=tiago", "elastic_transmission"], "is one of servos alone; tiago has fingers"),
        (
            ["gripper=dfki_pendulum", "back_emf"],
            "needs positions that are commanded; of dfki_pendulum it is the effort",
        ),
        (["gripper=so101_gripper", "backlsh"], "effect backlsh: no such effect"),
    ],
)
def test_mistakes(arguments, told, capsys):
    assert main(["effects", *arguments]) == 2
    out, err = capsys.readouterr()
    assert not out
    assert told in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("arguments", [["--help"], ["-h"], ["backlash", "--help"]])
def test_help(capsys, arguments):
    out = printed(capsys, *arguments)
    assert out.startswith("forcegrasp effects: ")
    assert "usage: forcegrasp effects [NAME]" in out


def test_imports_nothing_heavy():
    program = (
        "import sys; from forcegrasp.cli.main import main; main(['effects']); main(['effects', 'backlash']);"
        "sys.exit(' '.join({'torch', 'torchrl', 'matplotlib', 'scipy', 'hydra'} & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
