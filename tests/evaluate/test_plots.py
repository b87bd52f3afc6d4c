"""Pictures show whole forces, and one policy in one colour wherever it is drawn."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
import torch
from matplotlib.colors import to_hex
from tensordict import TensorDict

from forcegrasp.config import SensorConfig
from forcegrasp.controllers import CONTROLLERS
from forcegrasp.evaluate.colours import KNOWN, OTHERS, finger_colours, policy_colours
from forcegrasp.evaluate.curve_figure import draw_curves
from forcegrasp.evaluate.curve_groups import CURVES, Group
from forcegrasp.evaluate.grasp_figure import draw_grasps
from forcegrasp.evaluate.plots import cell_boxes, force_traces
from forcegrasp.policies import shipped_policies
from forcegrasp.runs.history import History

STEPS, GOAL_N = 50, 0.2


@pytest.fixture
def episodes() -> TensorDict:
    """Two episodes ``(2, T)`` whose forces shoot over the goal: by 400 % in the first, not at all in the second."""
    force = torch.full((2, STEPS, 2), GOAL_N)
    force[:, :10] = 0.0
    force[0, 10, 1] = 5 * GOAL_N
    rest = {
        "object_position": torch.zeros(2, STEPS, 1),
        "goal_force": torch.full((2, STEPS, 1), GOAL_N),
        "grasp_parameters": torch.tensor([0.5, -9.0, 0.02, 0.001, GOAL_N]).expand(2, STEPS, 5),
    }
    terms = {name: torch.zeros(2, STEPS, 1) for name in ("force_normalised", "force_paper", "object", "action")}
    held = {name: torch.zeros(2, STEPS, 2) for name in ("joint_position", "commanded_position")}
    now = {"force": force, "sensed_force": force, "measured_force": force, "reward_terms": terms, **rest, **held}
    return TensorDict({**now, "next": now}, batch_size=(2, STEPS))


def colours_of_lines(axes) -> set[str]:
    return {to_hex(line.get_color()) for line in axes.lines if line.get_label() in ("left", "right")}


def test_a_peak_is_drawn_whole_and_told(episodes):
    over, none = force_traces(episodes, "ib", "#0072b2").axes
    assert over.get_ylim()[1] > 5 * GOAL_N
    assert "overshoot 400%" in over.get_title()
    assert none.get_ylim()[1] < 1.5 * GOAL_N
    assert "overshoot 0%" in none.get_title()


def history(name: str) -> History:
    frames = np.array([1.0, 2.0])
    values = {column: frames for column, *_ in CURVES}
    return History(Path(name), name, {"curriculum.enabled": False, "ppo.total_frames": 2}, frames, values)


@pytest.mark.parametrize("names", [["ib", "force_pi", "my_run"], ["my_run", "informed", "ib", "no_ib"]])
def test_a_policy_has_one_colour_in_all_pictures(names, episodes):
    expected = policy_colours(names)
    assert expected["ib"] == KNOWN["ib"]
    assert expected["my_run"] == policy_colours(["my_run"])["my_run"]
    boxes = cell_boxes({name: np.random.default_rng(0).random((1, 5)) for name in names}, ["0"], "κ", "reward")
    faces = {text.get_text(): patch for text, patch in zip(*legend_of(boxes), strict=True)}
    curves = draw_curves([Group(name, [history(name)]) for name in names], np.linspace(1, 2, 5))
    lines = {text.get_text(): line for text, line in zip(*legend_of(curves), strict=True)}
    grasps = draw_grasps(dict.fromkeys(names, episodes[0]), SensorConfig())
    for name, grasp in zip(names, grasps, strict=True):
        colour = expected[name]
        assert to_hex(faces[name].get_facecolor()) == colour
        assert to_hex(lines[f"{name} (1 seed)"].get_color()) == colour
        assert colours_of_lines(force_traces(episodes, name, colour).axes[0]) == set(finger_colours(colour))
        forces, moved = grasp.axes
        assert colours_of_lines(forces) == set(finger_colours(colour))
        assert to_hex(moved.lines[0].get_color()) == colour


def legend_of(figure) -> tuple[list, list]:
    legend = figure.legends[0] if figure.legends else figure.axes[0].get_legend()
    return legend.get_texts(), legend.legend_handles


def test_what_comes_with_the_package_has_a_colour_of_its_own():
    assert set(KNOWN) == {*CONTROLLERS, *shipped_policies()}
    assert len({*KNOWN.values(), *OTHERS}) == len(KNOWN) + len(OTHERS)


def test_no_two_of_one_picture_share_a_colour_in_any_order():
    names = ["ib", *(f"run_{number}" for number in range(8)), "force_pi"]
    found = policy_colours(names)
    assert len(set(found.values())) == len(names)
    assert policy_colours(reversed(names)) == found
    for one, other in itertools.pairwise(names):
        assert len(set(policy_colours([one, other]).values())) == 2


def test_more_policies_than_colours_are_drawn_all_the_same():
    assert len(policy_colours(f"run_{number}" for number in range(40))) == 40
