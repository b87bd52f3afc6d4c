"""The functions on results made up by hand: what is simulated is tried by the verbs' own tests and by the tutorial."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from forcegrasp.diagnosis import add_effect, advice, diagnose_set
from forcegrasp.identify import comparison, fit_set, loading
from forcegrasp.identify import noise_floor as floor
from forcegrasp.reports import results
from tests.made_up import made_up as made_up  # a fixture

TABLE_META = "format: forcegrasp-measurements/1\nkind: final_force\ngripper: tiago\nsource: a test\nlicense: none\n"


@pytest.fixture
def table(tmp_path) -> Path:
    """A table of final forces with a dead zone."""
    folder = tmp_path / "table"
    folder.mkdir()
    (folder / "meta.yaml").write_text(TABLE_META)
    rows = [f"foam,{0.0002 * k:g},{0.06 * max(0, k - 1) + 0.001 * (-1) ** k:g}" for k in range(1, 11)]
    (folder / "table.csv").write_text("\n".join(["object,delta_q_m,final_force_n", *rows]) + "\n")
    return folder


@pytest.fixture
def work(made_up, monkeypatch, tmp_path) -> SimpleNamespace:
    """Nothing is simulated: what is slow returns what was made up. ``calls`` holds what it was asked."""
    calls: dict[str, tuple] = {}

    def returns(name: str, value: object) -> Callable:
        def stub(*arguments, **options):
            calls[name] = (*arguments, *options.values())
            return value

        return stub

    load, diagnosis = loading.load, made_up.diagnosis("effect")
    monkeypatch.chdir(tmp_path)
    names = ("my_set", [Path("my_set")])  # as the functions and as the verbs give it
    monkeypatch.setattr(loading, "load", lambda data: made_up.loaded if data in names else load(data))
    for home, name, value in (
        (comparison, "compare", (made_up.comparison, made_up.model, ["a note"])),
        (fit_set, "fit_model", (made_up.target, None, made_up.base)),
        (diagnose_set, "diagnose_set", (diagnosis, None)),
        (add_effect, "add_effect", made_up.added),
    ):
        monkeypatch.setattr(home, name, returns(name, value))
    monkeypatch.setattr(advice, "advise", lambda diagnosis: made_up.advice)
    monkeypatch.setattr("forcegrasp.api.functions.advise", lambda diagnosis: made_up.advice)
    for home in (floor, results):
        monkeypatch.setattr(home, "numerical_error", lambda fit, target: [])
    return SimpleNamespace(calls=calls, made_up=made_up)
