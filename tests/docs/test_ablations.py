"""The commands of the page on ablations are understood, with the files that it tells to write."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
import yaml

from forcegrasp.cli.options import compose
from forcegrasp.cli.train import single_runs

PAGE = (Path(__file__).parents[2] / "docs" / "ablations.md").read_text(encoding="utf-8")
COMMANDS = sorted(
    line.partition("#")[0].strip()
    for block in re.findall(r"^```sh\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    for line in block.splitlines()
    if line.startswith(("forcegrasp train", "forcegrasp render", "forcegrasp evaluate")) and "blind" not in line
)


@pytest.mark.parametrize("command", COMMANDS)
def test_command_is_understood(command):
    _, verb, *arguments = shlex.split(command)
    overrides = [argument for argument in arguments if argument != "-m"]
    for single in single_runs(overrides) if verb == "train" else [overrides]:
        compose(verb, single)


def test_every_experiment_of_the_presets_is_explained():
    for path in (Path(__file__).parents[2] / "conf" / "sweep").glob("*.yaml"):
        params = (yaml.safe_load(path.read_text()) or {}).get("hydra", {}).get("sweeper", {}).get("params", {})
        for name in params.get("experiment", "ib").split(","):
            assert f"`{name}`" in PAGE


def test_files_of_the_page_set_what_there_is():
    first, second, sweep = (yaml.safe_load(text) for text in re.findall(r"^```yaml\n(.*?)^```$", PAGE, re.M | re.S))
    parts = ",".join(first["observation"]["parts"])
    assert compose("train", [f"observation.parts=[{parts}]"]).observation.parts == first["observation"]["parts"]
    compose("train", ["experiment=no_ib", f"grasp.kappa={second['grasp']['kappa']}"])
    assert next(iter(sweep["hydra"]["sweeper"]["params"])) == "seed"
