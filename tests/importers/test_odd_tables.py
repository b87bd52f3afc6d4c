"""CSV and Parquet files by a map, as loggers, spreadsheets and libraries write them."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from forcegrasp.errors import MeasurementError
from forcegrasp.importers import Recording, read_source

TIME = np.arange(20) * 0.01
COMMAND = np.round(np.sin(9 * TIME), 4)
POSITION = np.round(np.sin(9 * TIME - 0.2), 4)
ROWS = list(zip(TIME.tolist(), COMMAND.tolist(), POSITION.tolist(), strict=True))
MAP = "time: t\njoints: a\ncommand: goal\nposition: pos\n"


def read(file: Path, how: str = MAP) -> list[Recording]:
    how_file = file.parent / "map.yaml"
    how_file.write_text(how)
    return read_source([file], "", str(how_file), [])


def lines(row: str) -> str:
    return "\n".join(row.format(t=t, c=c, p=p) for t, c, p in ROWS)


@pytest.mark.parametrize(
    ("text", "note"),
    [
        ("t,goal,pos\n" + lines("{t},{c},{p}") + "\n\n  \n,,\n\n", None),
        ('"t", "goal", "pos"\n' + lines('"{t}", "{c}", "{p}"'), None),
        ("\ufefft,goal,pos,\n" + lines("{t},{c},{p},"), None),
        ("t,goal,pos\n" + lines("{t},{c},{p},"), None),
        ("t\tgoal\tpos\r\n" + lines("{t}\t{c}\t{p}").replace("\n", "\r\n"), "separated by tabs"),
        ("sep=;\r\nt;goal;pos\r\n" + lines("{t};{c};{p}").replace("\n", "\r\n"), "separated by semicolons"),
        ("t,goal,pos\r" + lines("{t},{c},{p}").replace("\n", "\r"), None),
        ("t goal  pos\n" + lines("  {t}  {c} {p} "), "separated by spaces"),
        ("# made with numpy.savetxt\n# t goal pos\n" + lines("{t:.18e} {c:.18e} {p:.18e}"), "separated by spaces"),
        ("# t,goal,pos\n" + lines("{t},{c},{p}"), None),
        ("#t;goal;pos\n" + lines("{t};{c};{p}").replace(".", ","), "separated by semicolons"),
        ("# a comment\nt,goal,pos\n#more\n" + lines("{t},{c},{p}") + "\n# the end", None),
    ],
)
def test_tables_that_say_the_same(text, note, tmp_path):
    (tmp_path / "log.csv").write_bytes(text.encode())
    (one,) = read(tmp_path / "log.csv")
    np.testing.assert_allclose(one.time_s, TIME, atol=1e-9)
    np.testing.assert_allclose(one.command[:, 0], COMMAND)
    np.testing.assert_allclose(one.position[:, 0], POSITION)
    assert [note for note in one.notes if "skipped" in note] == []
    assert note is None or note in one.notes[0]


@pytest.mark.parametrize("encoding", ["cp1252", "utf-16"])
def test_text_in_another_encoding_is_read_and_said(encoding, tmp_path):
    (tmp_path / "log.csv").write_bytes(("t,goal,pos,temp [°C]\n" + lines("{t},{c},{p},20")).encode(encoding))
    (one,) = read(tmp_path / "log.csv")
    assert one.notes == (f"log.csv: is read as {encoding}", "skipped: temp [°C]")
    (tmp_path / "log.csv").write_bytes(b"\x00\x01\x81\xff" * 9)
    with pytest.raises(MeasurementError, match="can't be read: it is no text"):
        read(tmp_path / "log.csv")


def test_times_of_every_kind(tmp_path):
    start = datetime(2026, 3, 1, 23, 59, 59, 900000)
    stamps = [start + timedelta(seconds=t) for t in TIME.tolist()]
    kinds = {
        "ns": ([str(1_767_225_600_000_000_000 + round(t * 1e9)) for t in TIME], "ns"),
        "us": ([str(round(t * 1e6)) for t in TIME], "us"),
        "iso": ([stamp.isoformat() for stamp in stamps], "s"),
        "blank": ([str(stamp) for stamp in stamps], "s"),
    }
    for name, (cells, unit) in kinds.items():
        rows = "\n".join(f"{t},{c},{p}" for t, (_, c, p) in zip(cells, ROWS, strict=True))
        (tmp_path / f"{name}.csv").write_text("t,goal,pos\n" + rows)
        (one,) = read(tmp_path / f"{name}.csv", MAP.replace("time: t", f"time: {{column: t, unit: {unit}}}"))
        np.testing.assert_allclose(one.time_s, TIME, atol=5e-7)
    frame = pl.DataFrame({"t": stamps, "goal": COMMAND, "pos": POSITION})
    for unit, zone in (("ns", None), ("us", "UTC"), ("ms", None)):
        column = pl.col("t").dt.cast_time_unit(unit).dt.replace_time_zone(zone)
        frame.with_columns(column).write_parquet(tmp_path / "log.parquet")
        np.testing.assert_allclose(read(tmp_path / "log.parquet")[0].time_s, TIME, atol=1e-6)
    frame.with_columns(pl.col("t") - stamps[0]).write_parquet(tmp_path / "log.parquet")
    np.testing.assert_allclose(read(tmp_path / "log.parquet")[0].time_s, TIME, atol=1e-6)


def test_words_for_numbers_and_names_of_runs(tmp_path):
    rows = [f"{t},{c},{p},{i < 10},{'up' if i < 12 else 'down'}" for i, (t, c, p) in enumerate(ROWS)]
    rows[3], rows[4], rows[19] = "0.03,NA,0,True,up", "0.04,0,nan,True,up", "0.19,0,0,True,"
    (tmp_path / "log.csv").write_text("t,goal,pos,on,run\n" + "\n".join(rows))
    up, down = read(tmp_path / "log.csv", MAP + "enabled: on\nrecording: run\n")
    assert (up.name, down.name, len(up.time_s), len(down.time_s)) == ("log_up", "log_down", 10, 7)
    assert up.enabled is not None
    assert down.enabled is not None
    assert (up.enabled.sum(), down.enabled.sum()) == (8, 0)
    assert up.notes == ("log_up: left out 2 rows without a number",)
    names = ["x"] * 10 + ["y"] * 10
    frame = {"t": TIME, "goal": COMMAND.astype(np.float32), "pos": [str(p) for p in POSITION], "run": names}
    pl.DataFrame(frame).write_parquet(tmp_path / "log.parquet")
    first, _ = read(tmp_path / "log.parquet", MAP + "recording: run\n")
    np.testing.assert_allclose(first.position[:, 0], POSITION[:10])


def test_a_folder_may_hold_hidden_and_empty_tables(tmp_path):
    (tmp_path / "log.csv").write_text("t,goal,pos\n" + lines("{t},{c},{p}"))
    (tmp_path / "stopped.csv").write_text("t,goal,pos\n")
    for hidden in (tmp_path / "._log.csv", tmp_path / ".ipynb_checkpoints" / "log.csv"):
        hidden.parent.mkdir(exist_ok=True)
        hidden.write_bytes(b"\0\5")
    (tmp_path / "map.yaml").write_text(MAP)
    (one,) = read_source([tmp_path], "", str(tmp_path / "map.yaml"), [])
    assert one.notes == ("left out, for it is no recording: stopped.csv",)


def test_all_columns_that_are_wrong_are_told_at_once(tmp_path):
    (tmp_path / "log.csv").write_text("t,goal,pos,on\n" + lines("{t} s,{c},{p},yes"))
    with pytest.raises(MeasurementError) as caught:
        read(tmp_path / "log.csv", "time: t\njoints: a\ncommand: gaol\nposition: pos\neffort: i\nenabled: on\n")
    assert str(caught.value) == (
        f"{tmp_path / 'log.csv'}: no column called gaol, i; it has goal, pos, t, on; no numbers in column"
        " t (row 2 has '0.0 s'), on (row 2 has 'yes')"
    )
    (tmp_path / "log.csv").write_text("t,goal,pos\ns,rad,rad\n" + lines("{t},{c},{p}"))
    with pytest.raises(MeasurementError, match=r"no numbers in column t \(row 2 has 's'\), goal .*, pos .*"):
        read(tmp_path / "log.csv")


def test_a_wrong_row_is_named_as_an_editor_counts_lines(tmp_path):
    above = "sep=,\n# of Monday\nt,goal,pos\n\n"
    (tmp_path / "log.csv").write_text(above + "s,rad,rad\n" + lines("{t},{c},{p}"))
    with pytest.raises(MeasurementError, match=r"no numbers in column t \(row 5 has 's'\)"):
        read(tmp_path / "log.csv")
    (tmp_path / "log.csv").write_text(above + "0,1\n" + lines("{t},{c},{p}"))
    with pytest.raises(MeasurementError, match=r"log.csv, row 5: 2 cells under 3 names"):
        read(tmp_path / "log.csv")
