"""The pages of the formats name every key that a file may have, and no table row has a key that it may not."""

from __future__ import annotations

import re

import pytest
from doc_pages import PAGES

from forcegrasp.files.validate import Record
from forcegrasp.measure.read import Meta
from forcegrasp.measure.servo_set import ServoMeta
from forcegrasp.models.model_file import _File
from forcegrasp.physics.gripper_schema import (
    Description,
    MechanismDescription,
    ParameterEntry,
    ServoParameter,
    TrainingEntry,
)


def keys_of(record: type[Record]) -> set[str]:
    """Keys at the top of a file or section, and one level below."""
    below = (getattr(field.annotation, "__args__", (field.annotation,)) for field in record.model_fields.values())
    records = [kind for kinds in below for kind in kinds if isinstance(kind, type) and issubclass(kind, Record)]
    return {*record.model_fields, *(key for one in records for key in one.model_fields)}


@pytest.mark.parametrize(
    ("page", "record"),
    [
        ("docs/your-gripper.md", Description),
        ("docs/your-gripper.md", ParameterEntry),
        ("docs/your-gripper.md", TrainingEntry),
        ("docs/compare-your-data.md", Meta),
        ("docs/servos.md", ServoMeta),
        ("docs/servos.md", MechanismDescription),
        ("docs/servos.md", ServoParameter),
        ("docs/compare-your-data.md", _File),
    ],
)
def test_every_key_is_on_the_page(page, record):
    rows = "\n".join(line for line in PAGES[page].splitlines() if line.startswith("| "))
    assert {key for key in keys_of(record) if not re.search(rf"`[^`\n]*\b{key}\b", rows)} == set()


def test_what_a_training_draws_has_no_other_keys():
    section = PAGES["docs/your-gripper.md"].split("### What a training draws")[1].split("###")[0]
    rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    assert {key for row in rows for key in re.findall(r"`(\w+)`", row)} == set(TrainingEntry.model_fields)
