"""Files of others are read up to a size, and nothing but ordinary ones."""

from __future__ import annotations

import os

import pytest

from forcegrasp.files.bounded import read_bytes


def test_a_file_of_the_largest_size_is_read_whole(tmp_path):
    (tmp_path / "file").write_bytes(b"x" * 1000)
    assert read_bytes(tmp_path / "file", 1000) == b"x" * 1000
    with pytest.raises(OSError, match="larger than 0 kB"):
        read_bytes(tmp_path / "file", 999)


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="not an ordinary file"):
        read_bytes(tmp_path / "pipe", 1000)
