"""The slide: nothing changes at null values, every effect shows as it must, and sets are written whole."""

from __future__ import annotations

import csv
import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from .catalogue import CATALOGUE, CLASSES, OUTSIDE, build_effects
from .slide import EFFECTS, POSITION_STD_M, SAMPLE_S, Log, record, simulate


@cache
def slide(name: str = "", size: str = "large", **parameters: float) -> Log:
    """Two recordings without noise, the first with loads from outside, with one effect."""
    chosen = {name: parameters or size} if name else {}
    return simulate(build_effects(chosen), 1, recordings=2, samples=400, noise=False)


def test_null_effects_change_no_bit() -> None:
    everything = {name: CLASSES[name]() for name in EFFECTS}
    plain, null = (simulate(effects, 3, recordings=2, samples=120) for effects in ({}, everything))
    np.testing.assert_array_equal(plain.position, null.position)


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_shows(name: str) -> None:
    assert name in CATALOGUE | OUTSIDE
    hidden = slide(name)
    assert np.isfinite(hidden.position).all()
    assert np.abs(hidden.position - slide().position).max() > 3 * POSITION_STD_M


def test_a_loaded_slide_yields_as_its_servo_lets_it() -> None:
    plain = slide()
    assert plain.load[:, ::2].any()
    assert not plain.load[:, 1::2].any()
    held = plain.load != 0
    assert np.abs(plain.position - plain.command)[held].max() > 0.05 * np.abs(plain.load).max() / 100


def test_record(tmp_path: Path) -> None:
    truth = record(tmp_path / "a", {"swinging_load": "small", "motor_offset": "medium"}, 1, recordings=2, samples=50)
    assert truth["elastic_transmission"]["share"] == 0.1
    assert truth["motor_offset"] == {"left": 0.03, "right": 0.03}
    assert json.loads((tmp_path / "a.truth.json").read_text()) == truth
    names = {"meta.yaml", "recordings.csv", "samples.csv", "slide.xml", "slide.yaml"}
    assert {path.name for path in (tmp_path / "a").iterdir()} == names
    rows = list(csv.DictReader((tmp_path / "a" / "samples.csv").read_text().splitlines()))
    assert len(rows) == 2 * 50
    assert float(rows[1]["t_s"]) == SAMPLE_S
