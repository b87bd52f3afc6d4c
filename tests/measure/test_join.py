"""Sets of one gripper as one: what is told apart, what is taken for the same, and what is refused."""

from __future__ import annotations

import dataclasses
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from measured_rig import change, make_grasp, make_set

from forcegrasp.assets import __file__ as assets
from forcegrasp.errors import ConfigError, MeasurementError
from forcegrasp.identify.loading import load
from forcegrasp.measure import FinalForceTable, MeasurementSet, check_set, write_set, write_table
from forcegrasp.measure.join import join
from forcegrasp.measure.schema import fingerprint_of_table


@pytest.fixture
def sets(grasps, tmp_path) -> tuple[Path, Path]:
    """Six grasps, and two more of another day, one of which has the name of one of them."""
    made = [make_grasp(k, radius=0.025, offset=0.0) for k in (10, 12)]
    others = [
        change(made[0], name=grasps[0].name, session="monday", split=None),
        change(made[1], name="another", object="stone", session="friday"),
    ]
    return (
        write_set(make_set(grasps), tmp_path / "first"),
        write_set(make_set(others), tmp_path / "second"),
    )


def joined(paths) -> MeasurementSet:
    measured = load(list(paths)).measured
    assert isinstance(measured, MeasurementSet)
    return measured


def test_what_clashes_is_told_apart_and_nothing_else(sets, grasps):
    measured = joined(sets)
    first, second = (load(path).measured for path in sets)
    names, sessions = [g.name for g in measured.grasps], [g.session for g in measured.grasps]
    clash = grasps[0].name
    assert names == [f"{clash} of first", *(g.name for g in grasps[1:]), f"{clash} of second", "another"]
    assert sessions == [*["monday of first"] * 3, *["tuesday"] * 3, "monday of second", "friday"]
    assert measured.name == "first + second"
    assert measured.path == Path(f"[{sets[0]},{sets[1]}]")
    for one, before in zip(measured.grasps, [*first.grasps, *second.grasps], strict=True):
        assert np.array_equal(one.position_m, before.position_m)
        assert (one.object, one.radius_m, one.split) == (before.object, before.radius_m, before.split)


def test_one_line_says_which_objects_are_the_same(sets, grasps):
    told = [w for w in load(list(sets)).warnings if "same object" in w]
    assert told == [f"taken for the same object where several sets have it: '{grasps[0].object}'"]
    assert not any("one grasp only" in w for w in load(list(sets)).warnings)


def test_a_set_of_one_grasp_is_odd_alone_only(sets, grasps, tmp_path):
    one = write_set(make_set([make_grasp(9, radius=0.025, offset=0.0)]), tmp_path / "one")
    assert any("one grasp only" in w for w in load(one).warnings)
    assert not any("one grasp only" in w for w in load([sets[0], one]).warnings)


def test_the_fingerprint_is_that_of_the_parts(sets, tmp_path):
    both, back = joined(sets), joined(reversed(sets))
    assert both.fingerprint == back.fingerprint
    assert both.fingerprint not in {load(path).measured.fingerprint for path in sets}
    renamed = shutil.copytree(sets[1], tmp_path / "third")  # its grasps have other names then, which models use
    assert joined([sets[0], renamed]).fingerprint != both.fingerprint


def test_folders_of_one_name_are_told_apart_by_their_paths(sets, tmp_path):
    renamed = shutil.copytree(sets[1], tmp_path / "day" / "first")
    measured = joined([sets[0], renamed])
    assert measured.grasps[0].name.endswith(f" of {sets[0]}")
    assert measured.grasps[6].name.endswith(f" of {renamed}")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, "first: holds the same as"),
        ({"position_std_m": 1e-4}, "position_std_m is 0.0001, in"),
        ({"force_std_n": None}, "force_std_n is not given, in"),
        ({"offset_std_m": 1e-3}, "offset_std_m is 0.001, in"),
        ({"delay_std_s": 1e-3}, "delay_std_s is 0.001, in"),
        ({"kind": "servo"}, "is of kind servo, first of kind grasps; only sets of one kind can be joined"),
    ],
)
def test_what_does_not_fit_is_refused(changes, words, grasps):
    first = make_set(grasps, Path("first"))
    other = dataclasses.replace(first, fingerprint="other" if changes else first.fingerprint, **changes)
    with pytest.raises(MeasurementError, match=re.escape(words)) as caught:
        join([first, other], "tiago")
    assert len(str(caught.value).splitlines()) == 1


def test_one_name_for_two_objects_is_refused(grasps):
    first = make_set(grasps, Path("first"))
    near, far = (
        make_set([change(g, radius_m=g.radius_m + more, name=f"x{g.name}") for g in grasps], Path("second"))
        for more in (1e-4, 1e-3)
    )
    assert len(join([first, near], "tiago").grasps) == 12
    with pytest.raises(MeasurementError, match=r"'wood' has a radius of 21 mm, in first 20 mm; give another object"):
        join([first, far], "tiago")


def test_what_one_set_gives_and_another_does_not_is_told(grasps):
    first = make_set(grasps, Path("first"))
    thing = grasps[0].object
    bare = [change(g, radius_m=None, name=f"x{g.name}") for g in grasps if g.object == thing]
    second = dataclasses.replace(make_set(bare, Path("second")), name="second")
    told = join([first, second], "tiago").notes
    line = f"second: gives no radius of '{thing}', {first.name} does; give it in both, or it is fitted"
    assert [one for one in told if "radius" in one] == [line]
    alike = make_set([change(g, name=f"y{g.name}") for g in grasps], Path("third"))
    assert not [one for one in join([first, alike], "tiago").notes if "radius" in one]


@pytest.mark.parametrize(("factor", "told"), [(1.1, 0), (2.0, 1), (0.5, 1)])
def test_another_control_period_is_told(grasps, factor, told):
    first = make_set(grasps, Path("first"))
    slow = [change(g, time_s=factor * g.time_s, name=f"x{g.name}") for g in grasps]
    second = dataclasses.replace(make_set(slow, Path("second")), name="second")
    lines = [one for one in join([first, second], "tiago").notes if "apart" in one]
    assert len(lines) == told
    assert all(one.startswith(f"second: commands are {0.04 * factor:g} s apart, in ") for one in lines)
    assert all("are time stamps of one too long?" in one for one in lines)


def test_the_parts_of_joined_sets_keep_the_names_that_they_have_there(sets, grasps):
    whole = load(list(sets))
    clash = grasps[0].name
    assert [part.measured.name for part in whole.parts] == ["first", "second"]
    assert [g.name for part in whole.parts for g in part.measured.grasps] == [g.name for g in whole.measured.grasps]
    assert whole.parts[1].measured.grasps[0].name == f"{clash} of second"
    assert load(sets[0]).parts == ()


def test_a_table_and_grasps_are_not_joined(sets, tmp_path):
    path = write_table(table(tmp_path / "t", 0.1), tmp_path / "t")
    with pytest.raises(MeasurementError, match=r"t: is of kind final_force, .* of kind grasps"):
        load([sets[0], path])


def table(path: Path, more: float, sessions: tuple[str, ...] = ()) -> FinalForceTable:
    delta = np.arange(1, 7) * 1e-3
    facts = ("tiago", 0.01, ("foam",) * 6, delta, 100 * delta + more)
    return FinalForceTable(
        path, path.name, "tiago", "", "", 0.01, facts[2], delta, facts[4], fingerprint_of_table(*facts, sessions),
        sessions=sessions,
    )  # fmt: skip


def test_each_table_is_a_session_of_its_own(tmp_path):
    paths = [write_table(table(tmp_path / name, more), tmp_path / name) for name, more in (("a", 0.0), ("b", 0.1))]
    both = load(paths)
    assert isinstance(both.measured, FinalForceTable)
    assert both.measured.sessions == ("a",) * 6 + ("b",) * 6
    assert both.measured.final_force_n[6] == pytest.approx(both.measured.final_force_n[0] + 0.1)
    assert [w for w in both.warnings if "same object" in w]


def test_sessions_of_tables_that_clash_are_told_apart(tmp_path):
    one, other = (table(tmp_path / name, more, ("day",) * 6) for name, more in (("a", 0.0), ("b", 0.1)))
    assert join([one, other], "tiago").sessions == ("day of a",) * 6 + ("day of b",) * 6


def test_another_gripper_is_refused_and_a_copy_of_the_same_is_not(sets, grasps, tmp_path):
    shipped = Path(assets).parent
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        for file in ("tiago.yaml", "tiago.xml"):
            shutil.copy(shipped / file, tmp_path / name / file)
    paths = [
        write_set(make_set(grasps[k:], gripper=str(tmp_path / name / "tiago.yaml")), tmp_path / name / "s")
        for k, name in enumerate("ab")
    ]
    both = load(paths)
    assert both.measured.gripper == both.gripper.name_or_path == str((tmp_path / "a" / "tiago.yaml").resolve())
    text = (tmp_path / "b" / "tiago.yaml").read_text()
    (tmp_path / "b" / "tiago.yaml").write_text(text.replace("period_s: 0.04", "period_s: 0.05"))
    with pytest.raises(ConfigError, match=r"is of gripper .*; only sets of one gripper can be joined"):
        load(paths)


def test_no_set_at_all_is_refused():
    with pytest.raises(ConfigError, match="name a set"):
        load([])


def test_a_joined_set_can_be_right(sets):
    """It passes the checks of a set, whatever it was put together from."""
    measured = joined(sets)
    check_set(measured, 0.045)
