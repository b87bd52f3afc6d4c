"""Model files: what was written is read again, and whatever is wrong with one is told in a line that names the key."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest

from forcegrasp.effects import catalogue, get_effect
from forcegrasp.effects.for_gripper import effect_of, effects_of
from forcegrasp.errors import ConfigError
from forcegrasp.models.model_file import Fitted, FoundEffect, Model, read_model, write_model
from forcegrasp.physics.gripper_file import load_gripper

SECOND = Path(__file__).parents[1] / "grippers" / "second.yaml"
GOOD = """\
format: forcegrasp-model/1
gripper: tiago
mujoco: 4.0.0
data: {set: mine, fingerprint: 0abc}
base:
  position_gain: {value: 81.5, low: 80.0, high: 83.0, unit: N/m}
  velocity_gain: {value: -9.5, low: -10.0, high: -9.0, unit: N·s/m}
objects:
  sponge:
    rho_m: {value: 0.006, low: 0.005, high: 0.007, unit: m}
grasps:
  g001:
    offset_m: {value: 0.001, low: -0.001, high: 0.002, unit: m}
effects:
  backlash:
    variant: loose
    gap_m: {value: 0.0004, low: 0.0003, high: 0.0005, unit: m}
  force_bias:
    left_n: {value: 0.01, low: 0.0, high: 0.02, unit: N}
    right_n: -0.02
warnings: [hardly fixed]
"""
GAP = "gap_m: {value: 0.0004, low: 0.0003, high: 0.0005, unit: m}"
GAIN = "position_gain: {value: 81.5, low: 80.0, high: 83.0, unit: N/m}"


def put(folder: Path, text: str | bytes) -> Path:
    path = folder / "model.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def refuse(path: Path, *parts: str) -> None:
    """Asserts that reading is refused in one printable line that names the file and says all of this."""
    with pytest.raises(ConfigError) as caught:
        read_model(path)
    message = str(caught.value)
    assert message.splitlines() == [message]
    assert message.isprintable()
    assert message.startswith(f"{path}: ")
    assert len(message) < 900
    for part in parts:
        assert part in message, message


def test_every_part_is_read(tmp_path):
    model = read_model(put(tmp_path, GOOD))
    assert model.gripper.name == "tiago"
    assert model.base == {
        "position_gain": Fitted(81.5, 80.0, 83.0, "N/m"),
        "velocity_gain": Fitted(-9.5, -10.0, -9.0, "N·s/m"),
    }
    assert model.objects == {"sponge": {"rho_m": Fitted(0.006, 0.005, 0.007, "m")}}
    assert model.grasps == {"g001": {"offset_m": Fitted(0.001, -0.001, 0.002, "m")}}
    backlash, bias = model.effects
    assert (backlash.effect, backlash.variant) == (get_effect("backlash"), "loose")
    assert backlash.parameters == {"gap_m": Fitted(0.0004, 0.0003, 0.0005, "m")}
    assert bias.parameters["right_n"] == Fitted(-0.02, -0.02, -0.02, "N")  # a number alone is certain
    assert np.array_equal(bias.values, [0.01, -0.02])
    assert model.data == {"set": "mine", "fingerprint": "0abc"}
    assert model.warnings == ("hardly fixed",)


def test_round_trip(tmp_path):
    model = read_model(put(tmp_path, GOOD))
    again = tmp_path / "new folder" / "again.yaml"
    write_model(model, again)
    assert read_model(again) == model
    assert again.read_text(encoding="utf-8").startswith("# A model of a gripper")


def test_round_trip_of_every_effect_and_variant(tmp_path):
    seen = set()
    for gripper in map(load_gripper, ("tiago", "so101_jaw", "xl330_pendulum")):
        parameters_of = gripper.parameters.items()
        base = {n: Fitted(p.nominal, p.low, p.high, p.unit) for n, p in parameters_of if p.scope == "gripper"}
        for effect in effects_of(gripper).values():
            seen.add(effect.name)
            for variant in effect.variants:
                sizes = {p: [float(f"{x:.6g}") for x in (p.typical, p.low, p.high, p.null)] for p in effect.parameters}
                bounds = {p.name: Fitted(*size[:3], p.unit) for p, size in sizes.items()}
                absent = {p.name: Fitted(*size[3:] * 3, p.unit) for p, size in sizes.items()}  # even if infinite
                for parameters in (bounds, absent):
                    model = Model(gripper, base, effects=(FoundEffect(effect, variant, parameters),))
                    write_model(model, tmp_path / "model.yaml")
                    assert read_model(tmp_path / "model.yaml") == model
    assert seen == set(catalogue()) - {"viscous_friction"}  # which all grippers that are shipped fit as damping


def test_round_trip_of_another_gripper_and_odd_names(tmp_path):
    gripper = load_gripper(str(SECOND))
    base = {n: Fitted(p.nominal, p.low, p.high, p.unit) for n, p in gripper.parameters.items() if p.scope == "gripper"}
    names = ("1", "null", "2026-11-20", "a: b", "# c", "Schwämmchen", "- x", "<b>", "'", '"', "", "true", "1e3", "l\nm")
    scale = {"contact_stiffness": Fitted(1500.0, 1200.0, 1600.0, gripper.parameters["contact_stiffness"].unit)}
    model = Model(gripper, base, dict.fromkeys(names, scale), data={"set": "a: [b"}, warnings=names)
    write_model(model, tmp_path / "model.yaml")
    assert read_model(tmp_path / "model.yaml") == model


def test_written_numbers_keep_eight_digits_and_their_order(tmp_path):
    third, model = 1 / 3, read_model(put(tmp_path, GOOD))
    base = model.base | {"position_gain": Fitted(100 + third, 100 + third, 100 + third + 1e-9, "N/m")}
    write_model(dataclasses.replace(model, base=base), tmp_path / "model.yaml")
    read = read_model(tmp_path / "model.yaml").base["position_gain"]
    assert read.low <= read.value <= read.high
    assert read.value == pytest.approx(100 + third, rel=1e-7)


def test_a_gripper_beside_the_file_is_found(tmp_path):
    for kind in ("yaml", "xml"):
        (tmp_path / f"second.{kind}").write_text(SECOND.with_suffix(f".{kind}").read_text())
    gripper = load_gripper(str(SECOND))
    base = {n: p.nominal for n, p in gripper.parameters.items() if p.scope == "gripper"}
    lines = "\n".join(f"  {name}: {value}" for name, value in base.items())
    model = read_model(put(tmp_path, f"format: forcegrasp-model/1\ngripper: second.yaml\nbase:\n{lines}\n"))
    assert model.gripper.path == tmp_path / "second.yaml"
    assert {name: fitted.value for name, fitted in model.base.items()} == base
    assert model.effects == ()


#: What is replaced, by what, and what the message must say.
BROKEN = {
    "no format": ("format: forcegrasp-model/1\n", "", ["format: must be forcegrasp-model/1"]),
    "format of the future": ("forcegrasp-model/1", "forcegrasp-model/2", ["format: must be forcegrasp-model/1"]),
    "another file's format": ("forcegrasp-model/1", "forcegrasp-gripper/1", ["format", "forcegrasp fit"]),
    "unknown key": ("warnings:", "warning:", [": warning: unknown", "did you mean warnings"]),
    "number as a key": ("warnings:", "7:", [": 7: unknown"]),
    "null as a key": ("warnings:", "null:", [": None: unknown"]),
    "no gripper": ("gripper: tiago\n", "", ["gripper: missing, such as `./my_gripper.yaml`"]),
    "gripper is a list": ("gripper: tiago", "gripper: [tiago]", ["gripper: must be"]),
    "unknown gripper": ("gripper: tiago", "gripper: tiagoo", ["gripper: ", "no such gripper", "tiago"]),
    "gripper's file is missing": ("gripper: tiago", "gripper: ./gone.yaml", ["gripper: ", "gone.yaml", "No such file"]),
    "gripper is a folder": ("gripper: tiago", "gripper: ../", ["gripper: ", "could not read"]),
    "empty gripper": ("gripper: tiago", "gripper: ''", ["gripper: "]),
    "another gripper": ("gripper: tiago", f"gripper: {SECOND}", ["base.position_gain: unknown"]),
    "no base": ("base:", "data2:", ["data2: unknown"]),
    "base is empty": (GOOD[GOOD.index("base:") : GOOD.index("objects:")], "base:\n", ["base: must be a mapping"]),
    "base is a list": (GOOD[GOOD.index("base:") : GOOD.index("objects:")], "base: [1]\n", ["base: must be a mapping"]),
    "base parameter missing": (f"  {GAIN}\n", "", ["base.position_gain: missing"]),
    "base parameter unknown": ("position_gain:", "positon_gain:", ["base.positon_gain", "did you mean position_gain"]),
    "base parameter of an object": (GAIN, f"{GAIN}\n  rho_m: 0.006", ["base.rho_m: unknown"]),
    "value is text": ("value: 81.5", "value: many", ["base.position_gain.value: must be a number"]),
    "value is text in YAML": ("value: 81.5", "value: 8e1", ["base.position_gain.value", "YAML wants 1.0e-3"]),
    "value is a list": ("value: 81.5", "value: [81.5]", ["base.position_gain.value: must be a number"]),
    "value is true": ("value: 81.5", "value: true", ["base.position_gain.value: must be a number"]),
    "value is a date": ("value: 81.5", "value: 2026-11-20", ["base.position_gain.value: must be a number"]),
    "value is NaN": ("value: 81.5", "value: .nan", ["base.position_gain.value: must be a number"]),
    "value is too long": ("value: 81.5", f"value: 1{'0' * 400}", ["base.position_gain.value: must be a number"]),
    "value is endless": ("value: 81.5", f"value: {'7' * 5000}", ["could not read the model"]),
    "value is missing": ("value: 81.5, ", "", ["base.position_gain.value: missing"]),
    "value is null": ("value: 81.5", "value:", ["base.position_gain.value: must be a number"]),
    "low is NaN": ("low: 80.0", "low: .nan", ["base.position_gain.low: must be a number"]),
    "low is null": ("low: 80.0", "low:", ["base.position_gain.low: must be a number"]),
    "low > value": ("low: 80.0", "low: 82.0", ["base.position_gain: low ≤ value ≤ high"]),
    "high < value": ("high: 83.0", "high: 81.0", ["base.position_gain: low ≤ value ≤ high"]),
    "number is null": (GAIN, "position_gain:", ["base.position_gain.value: must be a number, not None"]),
    "number has another key": ("high: 83.0", "hight: 83.0", ["base.position_gain.hight", "did you mean high"]),
    "value out of bounds": (GAIN, "position_gain: 500", ["base.position_gain: must lie in [30, 300] N/m"]),
    "low out of bounds": ("low: 80.0", "low: 8.0", ["base.position_gain: must lie in [30, 300] N/m"]),
    "high is infinite": ("high: 83.0", "high: .inf", ["base.position_gain: must lie in"]),
    "other unit": ("unit: N/m", "unit: N/mm", ["base.position_gain.unit: must be N/m"]),
    "unit is a list": ("unit: N/m", "unit: [N, m]", ["base.position_gain.unit: must be text"]),
    "objects are a list": ("objects:\n  sponge:", "objects:\n - sponge:", ["objects: must be a mapping"]),
    "objects are nothing": (
        GOOD[GOOD.index("objects:") : GOOD.index("grasps:")], "objects: 0\n", ["objects: must be a mapping"],
    ),
    "object is a number": (
        "sponge:\n    rho_m: {value: 0.006, low: 0.005, high: 0.007, unit: m}", "sponge: 3",
        ["objects.sponge: must be a mapping"],
    ),
    "object's parameter unknown": ("    rho_m:", "    rho:", ["objects.sponge.rho: unknown", "rho_m"]),
    "object's parameter out of bounds": ("high: 0.007", "high: 7", ["objects.sponge.rho_m: must lie in"]),
    "grasp's parameter unknown": ("    offset_m:", "    ofset_m:", ["grasps.g001.ofset_m", "did you mean offset_m"]),
    "unknown effect": ("  backlash:", "  backlsh:", ["effects: ", "no such effect", "did you mean backlash"]),
    "effect is a number": ("  backlash:", "  3:", ["effects: ", "no such effect", "forcegrasp effects lists them"]),
    "effects are a list": (GOOD[GOOD.index("effects:") :], "effects: [backlash]", ["effects: must be a mapping"]),
    "effects are an empty list": (GOOD[GOOD.index("effects:") :], "effects: []", ["effects: must be a mapping"]),
    "effect without parameters": (
        GOOD[GOOD.index("  backlash") : GOOD.index("  force_b")], "  backlash:\n", ["effects.backlash: must be"],
    ),
    "unknown variant": ("variant: loose", "variant: lose", ["effects.backlash.variant: must be play or loose"]),
    "variant is a list": ("variant: loose", "variant: [loose]", ["effects.backlash.variant: must be"]),
    "variant is nothing": ("variant: loose", "variant:", ["effects.backlash.variant: must be"]),
    "variant of an effect without": ("  force_bias:", "  force_bias:\n    variant: x", ["force_bias.variant: must be"]),
    "effect's parameter unknown": ("    gap_m:", "    gap:", ["effects.backlash.gap: unknown", "gap_m"]),
    "effect's parameter missing": (f"    {GAP}\n", "", ["effects.backlash.gap_m: missing"]),
    "effect's parameter out of bounds": (GAP, "gap_m: 0.5", ["effects.backlash.gap_m: must lie in [0, 0.006] m"]),
    "effect's interval out of bounds": ("low: 0.0003", "low: -0.1", ["effects.backlash.gap_m: must lie in"]),
    "effect's interval out of bounds around null": (
        GAP, "gap_m: {value: 0.0, low: -.inf, high: .inf}", ["effects.backlash.gap_m: must lie in"],
    ),
    "effect's parameter NaN": ("right_n: -0.02", "right_n: .nan", ["force_bias.right_n.value: must be a number"]),
    "effect's unit": ("high: 0.0005, unit: m", "high: 0.0005, unit: mm", ["effects.backlash.gap_m.unit: must be m"]),
    "data is a list": ("data: {set: mine, fingerprint: 0abc}", "data: [1]", ["data: must be a mapping"]),
    "data holds more than text": ("fingerprint: 0abc", "fingerprint: [1]", ["data.fingerprint: must be text"]),
    "warnings are text": ("[hardly fixed]", "hardly fixed", ["warnings: must be a list"]),
    "warnings hold more than text": ("[hardly fixed]", "[{a: 1}]", ["warnings[0]: must be text"]),
    "tag of Python": ("value: 81.5", "value: !!python/object/apply:os.getcwd []", ["could not read the model"]),
    "tag of one's own": ("value: 81.5", "value: !number 81.5", ["could not read the model"]),
    "not closed": ("unit: N/m}", "unit: N/m", ["could not read the model"]),
    "tabs": ("\n  position_gain", "\n\tposition_gain", ["could not read the model"]),
    "unknown anchor": ("value: 81.5", "value: *gone", ["could not read the model"]),
    "two documents": ("warnings:", "---\nwarnings:", ["could not read the model"]),
    "key of several lines": ("warnings:", '"one\\n\\e[31mtwo":', [": one [31mtwo: unknown"]),
    "very long key": ("warnings:", f"{'w' * 1000}:", ["unknown"]),
    "key is a list": ("warnings:", "? [a]\n:", ["could not read the model"]),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_broken_file_is_one_line_that_names_the_key(name, tmp_path):
    old, new, parts = BROKEN[name]
    assert GOOD.count(old) >= 1
    refuse(put(tmp_path, GOOD.replace(old, new, 1)), *parts)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\n# nothing\n",
        b"[]",
        b"model",
        b"3",
        b"\x00\x01\x02",
        b"\xff\xfe\x00",
        b"\x89PNG\r\n\x1a\n",
        b"{",
        b"a: b: c",
    ],
)
def test_what_is_no_model_at_all(content, tmp_path):
    refuse(put(tmp_path, content))


def test_nested_too_deeply(tmp_path):
    refuse(put(tmp_path, "[" * 20_000), "nested too deeply")


def test_aliases_that_grow_without_end_are_refused_at_once(tmp_path):
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 12)]
    data = GOOD.replace("fingerprint: 0abc", "fingerprint: *a11").replace("data:", "\n".join(lines) + "\ndata:")
    refuse(put(tmp_path, data), "anchors and aliases are not supported")
    nested = GOOD.replace("data: {set: mine, fingerprint: 0abc}", "data:\n" + "\n".join(f"  {x}" for x in lines))
    refuse(put(tmp_path, nested), "anchors and aliases are not supported")


def test_missing_file_and_folder(tmp_path):
    refuse(tmp_path / "gone.yaml", "No such file")
    refuse(tmp_path, "could not read the model")


def test_file_that_cannot_be_written(tmp_path):
    model = read_model(put(tmp_path, GOOD))
    for path in (tmp_path, tmp_path / "model.yaml" / "inside.yaml", Path(os.devnull) / "model.yaml"):
        with pytest.raises(ConfigError, match="could not write the model"):
            write_model(model, path)


# --- noise, and effects of other grippers --------------------------------------------------------------------------

NOISE = "noise: {position_std: 3.0e-05, force_std_n: 0.02}\n"


def test_noise_is_read_and_written(tmp_path):
    model = read_model(put(tmp_path, GOOD + NOISE))
    assert model.noise == (3e-5, 0.02)
    write_model(model, tmp_path / "again.yaml")
    assert read_model(tmp_path / "again.yaml").noise == (3e-5, 0.02)
    assert "noise: {position_std: 3.0e-05, force_std_n: 0.02}" in (tmp_path / "again.yaml").read_text()
    old = read_model(put(tmp_path, GOOD))  # files of before have none
    assert old.noise is None
    write_model(old, tmp_path / "again.yaml")
    assert "noise" not in (tmp_path / "again.yaml").read_text()


@pytest.mark.parametrize(
    ("noise", "key", "told"),
    [
        ("{position_std: 0, force_std_n: 0.02}", "noise.position_std", "must be positive"),
        ("{position_std: 3.0e-5, force_std_n: -0.02}", "noise.force_std_n", "must be positive"),
        ("{position_std: 3.0e-5, force_std_n: .inf}", "noise.force_std_n", "must be positive"),
        ("{position_std: 3.0e-5}", "noise.force_std_n", "missing"),
        ("{position_std: 3.0e-5, force_std: 0.02}", "noise.force_std", "did you mean force_std_n"),
        ("{position_std: wide, force_std_n: 0.02}", "noise.position_std", "must be a number"),
        ("[1, 2]", "noise", "must map position_std, force_std_n"),
    ],
)
def test_wrong_noise(tmp_path, noise, key, told):
    refuse(put(tmp_path, f"{GOOD}noise: {noise}\n"), key, told)


def test_effects_are_those_of_the_gripper(tmp_path):
    gripper = load_gripper("so101_gripper")
    base = {n: Fitted(p.nominal, p.low, p.high, p.unit) for n, p in gripper.parameters.items() if p.scope == "gripper"}
    backlash = effect_of("backlash", gripper)
    gap = {"gap_rad": Fitted(0.01, 0.009, 0.011, "rad")}
    write_model(Model(gripper, base, effects=(FoundEffect(backlash, "play", gap),)), tmp_path / "model.yaml")
    text = (tmp_path / "model.yaml").read_text()
    assert "gap_rad: {value: 0.01, low: 0.009, high: 0.011, unit: rad}" in text
    found = read_model(tmp_path / "model.yaml").effects[0]
    assert (found.effect, found.parameters) == (backlash, gap)
    refuse(put(tmp_path, text.replace("gap_rad", "gap_m")), "effects.backlash.gap_m", "did you mean gap_rad")
    refuse(put(tmp_path, text.replace("backlash:", "force_crosstalk:")), "force_crosstalk", "needs 2 force readings")


@pytest.mark.parametrize(("name", "parameters", "speed"), [
    ("tiago", ("breakaway_n", "kinetic_share", "stribeck_m_s"), 0.002),
    ("so101_gripper", ("breakaway_nm", "kinetic_share", "stribeck_rad_s"), 0.002 * 16),
])  # fmt: skip
def test_files_from_before_the_stribeck_velocity_was_fitted(tmp_path, name, parameters, speed):
    """It was 2 mm/s, times the gripper's scale of positions."""
    gripper = load_gripper(name)
    base = "".join(f"  {n}: {p.nominal}\n" for n, p in gripper.parameters.items() if p.scope == "gripper")
    text = f"format: forcegrasp-model/1\ngripper: {name}\nbase:\n{base}effects:\n  stiction:\n"
    old = text + f"    {parameters[0]}: 0.05\n    {parameters[1]}: 0.4\n"
    (found,) = read_model(put(tmp_path, old)).effects
    assert set(found.parameters) == set(parameters)
    assert found.values == pytest.approx([0.05, 0.4, speed])
    (said,) = read_model(put(tmp_path, f"{old}    {parameters[2]}: 0.01\n")).effects
    assert said.parameters[parameters[2]].value == 0.01
    refuse(put(tmp_path, text + f"    {parameters[1]}: 0.4\n"), f"effects.stiction.{parameters[0]}: missing")
