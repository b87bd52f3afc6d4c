"""docs/configuration.md says what the dataclasses and presets say. If this fails: python tools/config_page.py"""

from __future__ import annotations

import re
import runpy

import pytest

from forcegrasp.cli.options import SCHEMAS, groups, leaves


@pytest.fixture(scope="module")
def text(root) -> str:
    return (root / "docs" / "configuration.md").read_text(encoding="utf-8")


def test_page_is_up_to_date(text, root):
    assert text == runpy.run_path(str(root / "tools" / "config_page.py"))["page"]()


def test_every_option_and_preset_of_every_verb_is_there(text):
    parts = text.partition("\n## Parts")[2]
    for verb, schema in SCHEMAS.items():
        (section,) = re.findall(rf"^### {verb}\n(.*?)(?=^##)", text, re.MULTILINE | re.DOTALL)
        for name, _, _ in leaves(schema):
            assert f"| `{name}` |" in (parts if "." in name else section)
        for group, names in groups(verb).items():
            assert all(f"| `{group}={name}` |" in section for name in names)


@pytest.mark.parametrize(
    "row",
    [
        "| `grasp.radius_m` | the gripper's | m | 0.0001 to 1 |",
        "| `physics.tier` | `reference` |  | `reference` `fast` |",
        "| `ppo.total_frames` | `4500000` |  | 1 or more |",
        "| `experiment=no_rand` | `experiment=no_ib`, `'grasp.kappa=[0.5,0.5]'`, `grasp.servo_gain=nominal` |",
        "| `reward=goal_normalised` | `reward.form=goal_normalised` |",
        "| `sweep=parts` | `seed=0,1,2`, `experiment=ib,",
        "| `experiment=ib` | the defaults |",
        "[log](#log); here `physics.tier=fast`.",
    ],
)
def test_rows(text, row):
    assert row in text
