"""One writer at a time: a lock of the operating system, which ends with its process, however that ends."""

from __future__ import annotations

import contextlib
import fcntl
import os
import platform
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from forcegrasp.errors import CheckpointError


@contextmanager
def only_writer(path: Path) -> Iterator[None]:
    """Keeps every other process that asks for the same lock out of a folder.

    The file tells others who is at work. It is locked by ``flock``, so that what a kill leaves of it stops nobody; NFS
    keeps such locks between machines, and where a file system has none, a line on stderr says so.

    Args:
      path: the lock's file; its folder is made if need be.

    Raises:
      CheckpointError: if the lock is taken; says by whom.
      OSError: if the folder can't be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    file = _take(path)
    try:
        with contextlib.suppress(OSError):  # a full disk: what it says helps others, the lock needs none of it
            os.ftruncate(file, 0)
            os.pwrite(file, f"process {os.getpid()} on {platform.node()}".encode(), 0)
        yield
    finally:
        path.unlink(missing_ok=True)  # while it is still held, so that nobody else's is removed
        os.close(file)


def _take(path: Path) -> int:
    """Returns the descriptor of the locked file."""
    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o666)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            who = _holder(file)
            os.close(file)
            raise CheckpointError(
                f"{path.parent}: {who} is training here; wait until it has ended, or end it"
            ) from error
        except OSError as error:
            warning = f"no locks on this file system ({error.strerror}); see that nothing else trains here"
            print(f"forcegrasp: {path.parent}: {warning}", file=sys.stderr)
            return file
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(file), path.stat()):
                return file
        os.close(file)  # who had it removed it meanwhile


def _holder(file: int) -> str:
    """What the holder wrote, if it is that: others may write there, too."""
    said = os.pread(file, 200, 0).decode(errors="replace")
    return said if re.fullmatch(r"process \d+ on [\w.-]+", said) else "another process"
