"""Bytes changed at random: the set is read, or refused in one line. Nothing else may come out."""

from __future__ import annotations

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from measured_rig import OPEN_M

from forcegrasp.errors import MeasurementError
from forcegrasp.measure import check_set, read_set

BYTES = st.one_of(
    st.binary(max_size=12), st.sampled_from([b"\n", b",", b'"', b"\r", b"\xff", b"nan", b"-", b"1e9", b": "])
)


@settings(
    max_examples=80,
    deadline=2000,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    file=st.sampled_from(["meta.yaml", "grasps.csv", "samples.csv"]),
    edits=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 8), BYTES), min_size=1, max_size=4),
)
def test_bytes(folder, valid_files, file, edits):
    data = valid_files[file]
    for where, gone, new in edits:
        start = int(where * len(data))
        data = data[:start] + new + data[start + gone :]
    (folder / file).write_bytes(data)
    try:
        check_set(read_set(folder), OPEN_M)
    except MeasurementError as error:
        message = str(error)
        assert message.isprintable()
        assert folder.name in message
    finally:
        (folder / file).write_bytes(valid_files[file])
