"""Every option of record, compare, fit, diagnose and add changes something."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from forcegrasp.cli.main import main
from forcegrasp.cli.options import leaves
from forcegrasp.config import (
    AddConfig,
    CompareConfig,
    DiagnoseConfig,
    FitConfig,
    RecordConfig,
)

TINY_RECORD = {"grasps": 3, "objects": 2}
SECOND_GRIPPER = Path(__file__).parents[1] / "grippers" / "second.yaml"
MODEL = """format: forcegrasp-model/1
gripper: tiago
base:
  position_gain: {value: 80.0, low: 70.0, high: 90.0, unit: N/m}
  velocity_gain: {value: -9.0, low: -10.0, high: -8.0, unit: N·s/m}
effects: EFFECTS
"""

#: Option → another value than in the tiny recording.
RECORD_CASES: dict[str, Any] = {
    "plan": "close_and_hold",
    "out": "elsewhere",
    "effects": "[backlash]",
    "next": "diagnosis.json",
    "gripper": SECOND_GRIPPER,
    "model": "model.yaml",
    "grasps": 2,
    "objects": 1,
    "off_nominal": 0.0,
    "position_std_m": 1e-4,
    "force_std_n": 0.05,
    "samples": "parquet",
    "seed": 1,
}

#: The options of the verbs that read measurements. What they find is tested in tests/cli/test_measuring_verbs.py.
MEASURED_CASES: dict[type, dict[str, Any]] = {
    CompareConfig: {"data": "other", "model": "model.yaml", "out": "elsewhere", "seed": 1},
    FitConfig: {"data": "other", "out": "elsewhere", "seed": 1},
    DiagnoseConfig: {
        "data": "other",
        "model": "model.yaml",
        "out": "elsewhere",
        "effects": "[backlash]",
        "law": True,
        "minutes": 5.0,
        "seed": 1,
    },
    AddConfig: {"data": "other", "model": "lagging.yaml", "effect": "adhesion", "out": "elsewhere"},
}
MEASURED = {CompareConfig: "compare", FitConfig: "fit", DiagnoseConfig: "diagnose", AddConfig: "add"}
NEEDED = {AddConfig: {"model": "model.yaml", "effect": "backlash"}}


def recorded(out: Path, **values: Any) -> dict[str, str]:
    """Files that a tiny recording leaves behind."""
    options = [f"{name}={value}" for name, value in (TINY_RECORD | values).items()]
    assert main(["record", f"out={out}", *options]) == 0
    return {path.name: path.read_bytes().hex() for path in sorted(out.iterdir())}


@pytest.fixture(scope="module")
def plain_recording(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp("record") / "set")


def test_every_option_of_the_measuring_verbs_has_a_case():
    assert list(RECORD_CASES) == [name for name, *_ in leaves(RecordConfig)]
    for schema, cases in MEASURED_CASES.items():
        assert list(cases) == [name for name, *_ in leaves(schema)]


def test_the_same_recording_leaves_the_same(tmp_path, plain_recording):
    assert recorded(tmp_path / "set") == plain_recording


@pytest.mark.parametrize("name", [name for name in RECORD_CASES if name != "out"])
def test_option_of_record(name, tmp_path, plain_recording, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("model.yaml").write_text(MODEL.replace("EFFECTS", "{}"))
    grasp = next(csv.DictReader(bytes.fromhex(plain_recording["grasps.csv"]).decode().splitlines()))
    proposed = {"grasp": "long hold", "object": grasp["object"], "gripper": "tiago", "offset_m": 0.0, "contact": 0.02}
    proposed |= {"radius_m": float(grasp["object_radius_m"]), "squeeze": 0.003}
    Path("diagnosis.json").write_text(json.dumps({"verdict": "one_of", "next_grasp": proposed}))
    different = recorded(tmp_path / "set", **{name: RECORD_CASES[name]})
    said = {"meta.yaml"} if name != "seed" else set()  # which repeats the options
    samples = [f for f in different if f not in said]
    assert [different[f] for f in samples] != [plain_recording.get(f) for f in samples]


def test_out_is_where_record_writes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recorded(Path(RECORD_CASES["out"]))
    assert (tmp_path / "elsewhere" / "samples.csv").is_file()


class BegunError(Exception):
    """The expensive part would begin now; with what."""


def begun(monkeypatch, verb: str, **values: Any) -> dict[str, Any]:
    """What a verb sets out to compute: the arguments of the first expensive step, and where it would write."""
    from forcegrasp.diagnosis import add_effect, diagnose_set, set_search
    from forcegrasp.identify import fit_set
    from forcegrasp.identify.loading import Loaded
    from forcegrasp.identify.target import Target
    from forcegrasp.models.model_file import Model
    from forcegrasp.replay import time_limit

    def told(value: Any) -> Any:
        match value:
            case np.random.Generator():
                return int(value.integers(1 << 60))
            case Loaded():
                return value.measured.fingerprint
            case Model():
                return repr((value.base, value.effects))
            case Target():
                return value.signals.tolist()
            case list():
                return [told(item) for item in value]
            case int() | str() | type():
                return value

    def stop(*arguments, **_):
        raise BegunError(told(list(arguments)))

    def fitted(loaded, seed_or_model, *_, **__):
        return loaded, seed_or_model, SimpleNamespace(fit=None)

    reached: dict[str, Any] = {}
    monkeypatch.setattr("forcegrasp.cli.measuring.check_folder", lambda path: reached.setdefault("folder", path))
    monkeypatch.setattr("forcegrasp.cli.measuring.check_file", lambda path: reached.setdefault("file", path))
    monkeypatch.setattr("time.strftime", lambda *_: "NOW")
    for home, name in ((fit_set, "fit_base"), (set_search, "diagnose"), (add_effect, "add_effect")):
        monkeypatch.setattr(home, name, stop)
    if verb == "diagnose":
        monkeypatch.setattr(fit_set, "fit_model", fitted)
        monkeypatch.setattr(diagnose_set, "suspects", lambda *_: [])
        monkeypatch.setattr(set_search, "uneven_stamps", lambda *_: None)
        monkeypatch.setattr(set_search.SetSearch, "search_as_given", lambda *_: (None, False))
        monkeypatch.setattr(set_search, "with_fitted_givens", lambda *_: None)
        whole = diagnose_set.diagnose_set

        def noted(*arguments, law):
            reached["law"], reached["minutes"] = law, time_limit._LIMIT.get()[1]
            return whole(*arguments, law=law)

        monkeypatch.setattr(diagnose_set, "diagnose_set", noted)
    if verb != "add":
        monkeypatch.setattr(fit_set, "apply_model", fitted if verb == "diagnose" else stop)
    with pytest.raises(BegunError) as caught:
        main([verb, *(f"{name}={value}" for name, value in values.items())])
    return reached | {"arguments": caught.value.args[0]}


@pytest.fixture(scope="module")
def sets(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("sets")
    for seed, name in enumerate(("data", "other")):
        recorded(folder / name, grasps=6, seed=seed)
    (folder / "model.yaml").write_text(MODEL.replace("EFFECTS", "{}"))
    lag = "{force_lag: {time_constant_s: 0.1}}"
    (folder / "lagging.yaml").write_text(MODEL.replace("EFFECTS", lag))
    return folder


@pytest.fixture(scope="module")
def plainly() -> dict[type, dict[str, Any]]:
    """What each verb sets out to compute without another option, once it is known."""
    return {}


@pytest.mark.parametrize(
    ("schema", "name"), [(schema, name) for schema, cases in MEASURED_CASES.items() for name in cases]
)
def test_option_of_a_measuring_verb(schema, name, sets, plainly, monkeypatch):
    monkeypatch.chdir(sets)
    plain = {"data": "data"} | NEEDED.get(schema, {})
    if schema not in plainly:
        plainly[schema], again = (begun(monkeypatch, MEASURED[schema], **plain) for _ in range(2))
        assert plainly[schema] == again
    assert begun(monkeypatch, MEASURED[schema], **plain | {name: MEASURED_CASES[schema][name]}) != plainly[schema]
