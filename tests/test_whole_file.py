"""A file that was written whole is there after a power cut, too: its content is synced, and then its folder."""

from __future__ import annotations

import os
import stat

from forcegrasp.files.whole_file import write_whole


def test_content_and_then_the_folder_are_synced(tmp_path, monkeypatch):
    synced, sync = [], os.fsync

    def note(descriptor: int) -> None:
        is_folder = stat.S_ISDIR(os.fstat(descriptor).st_mode)
        synced.append(("folder" if is_folder else "file", (tmp_path / "a.bin").exists()))
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", note)
    write_whole(tmp_path / "a.bin", b"all of it")
    assert synced == [("file", False), ("folder", True)]  # the folder once the name is there
    assert (tmp_path / "a.bin").read_bytes() == b"all of it"
