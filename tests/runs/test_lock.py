"""One writer at a time, whatever becomes of the others."""

from __future__ import annotations

import errno
import fcntl
import os
import subprocess
import sys
from pathlib import Path

import pytest

from forcegrasp.errors import CheckpointError
from forcegrasp.runs.lock import only_writer


@pytest.fixture
def lock(tmp_path) -> Path:
    return tmp_path / "run" / "lock"


def test_a_second_writer_is_told_who_the_first_is(lock):
    with only_writer(lock):
        with pytest.raises(CheckpointError) as caught, only_writer(lock):
            pass
        assert str(caught.value).startswith(f"{lock.parent}: process {os.getpid()} on ")
        assert "\n" not in str(caught.value)
        with pytest.raises(CheckpointError), only_writer(lock):  # the first refusal took nothing away
            pass
    assert not list(lock.parent.iterdir())
    with only_writer(lock):
        pass


def test_another_process_and_its_kill(lock):
    hold = "import sys, time; from pathlib import Path; from forcegrasp.runs.lock import only_writer\n"
    hold += "with only_writer(Path(sys.argv[1])): print('held', flush=True); time.sleep(60)"
    with subprocess.Popen([sys.executable, "-c", hold, str(lock)], stdout=subprocess.PIPE) as process:
        assert process.stdout
        assert process.stdout.readline()
        with pytest.raises(CheckpointError, match=f"process {process.pid} on "), only_writer(lock):
            pass
        process.kill()
    assert lock.exists()
    with only_writer(lock):
        assert lock.read_text().startswith(f"process {os.getpid()} on ")


def test_what_others_wrote_there_is_not_shown(lock):
    with only_writer(lock):
        lock.write_text("\x1b[31mprocess 1 on me\nand more")
        with pytest.raises(CheckpointError, match="another process is training here"), only_writer(lock):
            pass


def test_a_link_is_not_followed(lock, tmp_path):
    lock.parent.mkdir()
    (tmp_path / "other").write_text("mine")
    lock.symlink_to(tmp_path / "other")
    with pytest.raises(OSError, match="symbolic"), only_writer(lock):
        pass
    assert (tmp_path / "other").read_text() == "mine"


def test_the_file_that_another_removed_meanwhile_is_no_lock(lock, monkeypatch):
    flock, removed = fcntl.flock, []

    def late(file, how):
        if not removed:
            removed.append(lock.unlink())
        flock(file, how)

    with monkeypatch.context() as patch:
        patch.setattr(fcntl, "flock", late)
        with only_writer(lock), pytest.raises(CheckpointError), only_writer(lock):
            pass
    assert removed


def test_a_file_system_without_locks_is_told(lock, monkeypatch, capsys):
    def none(file, how):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", none)
    with only_writer(lock):
        pass
    err = capsys.readouterr().err
    assert err.startswith(f"forcegrasp: {lock.parent}: no locks on this file system (No locks available)")
    assert err.count("\n") == 1
