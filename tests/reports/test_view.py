"""The view of a report shows the errors and the signals that were compared, and few enough numbers."""

from __future__ import annotations

import json

import numpy as np
import pytest

from forcegrasp.reports import view


@pytest.fixture(scope="module")
def data(made_up) -> dict:
    """What the view of two models reads, as a browser gets it."""
    predicted = {"without": made_up.added.before.predicted, "with": made_up.added.after.predicted}
    return json.loads(json.dumps(view.view_data(made_up.target, predicted), allow_nan=False))


def test_errors_are_those_of_the_comparison(made_up, data):
    target = made_up.target
    for cell in made_up.comparison.cells():
        row, phase = target.axis.names.index(cell.signal), target.phases.index(cell.phase)
        assert data["errors"][0][row][phase] == pytest.approx(cell.ratio, abs=0.006)
    worst = max(data["parts"], key=lambda part: part["errors"][0][2][3])
    assert worst["name"] == "g3 on thing 1"
    assert worst["errors"][1][2][3] < 1.5 < 8 < worst["errors"][0][2][3]


def test_signals_are_those_that_were_measured_to_a_twentieth_of_their_noise(made_up, data):
    target = made_up.target
    for index, part in enumerate(data["parts"]):
        for k, signal in enumerate(data["signals"]):
            factor = {"mm": 1e3, "N": 1.0}[signal["unit"]]
            measured = np.array(part["measured"][k]) * signal["step"] / factor
            assert np.abs(measured - target.signals[index, :, k]).max() <= 0.026 * target.sigma[k]
            residual = (np.array(part["measured"][k]) - np.array(part["predicted"][0][k])) * data["noise"]
            assert residual == pytest.approx(made_up.comparison.residual[index, :, k], abs=0.051)
    assert (data["signals"][0]["name"], data["sides"]) == ("position left", [[0, 2], [1, 3], [0, 2], [1, 3]])


def test_spans_cover_a_grasp_in_order(made_up, data):
    for index, part in enumerate(data["parts"]):
        phase, time = made_up.target.phase[index], np.array(part["time"])
        assert [span[0] for span in part["spans"]] == phase[np.flatnonzero(np.diff(phase, prepend=-2))].tolist()
        assert (part["spans"][0][1], part["spans"][-1][2]) == (time[0], time[-1])
        assert all(one[2] == other[1] for one, other in zip(part["spans"], part["spans"][1:], strict=False))


def test_of_very_many_samples_some_are_kept(made_up, monkeypatch):
    monkeypatch.setattr(view, "_MOST_NUMBERS", 8 * 150 * 11 // 3)
    few = view.view_data(made_up.target, {"model": made_up.added.before.predicted})
    assert few["every"] == 3
    assert few["parts"][0]["time"] == [round(0.12 * k, 5) for k in range(50)]
    assert {len(channel) for channel in few["parts"][0]["measured"] + few["parts"][0]["command"]} == {50}
    # errors are of all samples all the same
    assert few["errors"][0] == view.view_data(made_up.target, {"model": made_up.added.before.predicted})["errors"][0]
