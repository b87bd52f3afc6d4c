"""The README's moving pictures: what they show, and what is said where they can't be made."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image, ImageSequence

from forcegrasp.identify.comparison import Comparison
from forcegrasp.identify.target import make_target
from forcegrasp.measure import MeasuredGrasp, MeasurementSet
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.scene_renderer import no_renderer
from forcegrasp.reports.figures import WITH, WITHOUT
from tools import readme_pictures

SIGMA = np.array([2.7e-5, 2.7e-5, 0.013, 0.013])


@pytest.fixture(scope="module")
def beside_two_models() -> tuple[Comparison, Comparison]:
    """A grasp that closes, holds and opens; one model misses the right finger by 6 σ while closed, the other not."""
    time = np.arange(60) * 0.1
    command = np.interp(time, [0.4, 1.4, 4.0, 5.0], [0.045, 0.018, 0.018, 0.045])
    position = np.maximum(command, 0.0195)
    noise = SIGMA * np.random.default_rng(0).standard_normal((60, 4))
    signals = np.stack([position, position, *[200 * (position - command)] * 2], axis=1) + noise
    pair = np.stack([command, command], axis=1)
    grasp = MeasuredGrasp("g", "thing", "s", 0.02, 0.0, None, time, pair, signals[:, :2], signals[:, 2:], None)
    target = make_target(
        MeasurementSet(Path("set"), "set", "tiago", "", "", SIGMA[0], SIGMA[2], (grasp,), ""), load_gripper("tiago")
    )
    having = (noise / SIGMA)[None]
    missed = having + 6 * np.array([0, 1, 0, 1]) * (position < 0.02)[None, :, None]
    before, after = (Comparison(target, target.signals - r * SIGMA, r, r, 1.0) for r in (missed, having))
    return before, after


def area(picture: np.ndarray, colour: str) -> int:
    """Number of pixels of a colour."""
    return int(np.all(picture == np.round(255 * np.array(to_rgb(colour))), axis=-1).sum())


def test_error_falls_from_picture_to_picture(beside_two_models):
    pictures = readme_pictures.pictures_of_fall(*beside_two_models, effect="backlash", steps=3)
    assert len(pictures) == 4
    without = [area(picture, WITHOUT) for picture in pictures]
    assert without[0] > without[1] > without[2] > 0  # bars shrink, and a line gives way
    assert without[-1] == 0
    assert area(pictures[0], WITH) == 0 < area(pictures[1], WITH) < area(pictures[-1], WITH)


def test_the_finger_is_the_one_that_the_effect_moves(beside_two_models):
    assert readme_pictures._clearest(*beside_two_models) == (0, 1)


def test_pictures_move_and_start_over(tmp_path):
    pictures = [np.full((8, 8, 3), value, np.uint8) for value in (0, 120, 255)]
    readme_pictures.write_gif(pictures, tmp_path / "moving.gif")
    with Image.open(tmp_path / "moving.gif") as moving:
        assert (len(list(ImageSequence.Iterator(moving))), moving.info["loop"]) == (3, 0)


def test_where_nothing_can_be_rendered_a_line_says_so_and_nothing_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("forcegrasp.physics.scene_renderer.backends", lambda: ())
    monkeypatch.setattr(readme_pictures, "GRASP", ["render", "policies=[force_pi]", "steps=2"])
    monkeypatch.setattr(sys, "argv", ["readme_pictures.py", "--out", str(tmp_path)])
    with pytest.raises(SystemExit) as ended:
        readme_pictures.main()
    assert ended.value.code == 2
    assert capsys.readouterr().err.strip() == f"forcegrasp: {no_renderer()}"
    assert not list(tmp_path.iterdir())
