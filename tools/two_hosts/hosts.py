"""Machines of one's own: network namespaces of this one, each with its address, name, processes and temporary files."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from pathlib import Path

#: They see each other, and nobody else.
ADDRESSES = {"one": "10.77.0.1", "two": "10.77.0.2"}

#: What each has for itself; the rest of the disk they share, as machines of a cluster do.
OWN_FOLDERS = ("/tmp", "/run", "/dev/shm")


class Host:
    """A machine that lives until :meth:`kill`, with all its processes.

    Args:
      name: of :data:`ADDRESSES`.
      folder: on the shared disk, for what its programs print.
    """

    def __init__(self, name: str, folder: Path) -> None:
        self.name, self.address, self.folder = name, ADDRESSES[name], folder
        names = folder / "hosts"
        names.write_text("127.0.0.1 localhost\n" + "".join(f"{address} {n}\n" for n, address in ADDRESSES.items()))
        mounts = " && ".join(f"mount -t tmpfs own {path}" for path in OWN_FOLDERS)
        begin = f"hostname {name} && mount --bind {names} /etc/hosts && {mounts} && ip link set lo up"
        apart = ["unshare", "--net", "--uts", "--mount", "--ipc", "--pid", "--fork", "--kill-child", "--mount-proc"]
        with open(folder / f"{name}-host.log", "ab") as log:
            self._unshare = subprocess.Popen(
                [*apart, "sh", "-c", f"{begin} && exec sleep infinity"], stdout=log, stderr=subprocess.STDOUT
            )
        self.pid = self._first_process()

    def _first_process(self) -> int:
        """The process that all others of the host end with."""
        children = Path(f"/proc/{self._unshare.pid}/task/{self._unshare.pid}/children")
        for _ in range(100):
            time.sleep(0.05)
            if (found := children.read_text().split()) and Path(f"/proc/{found[0]}/comm").read_text() == "sleep\n":
                return int(found[0])
        self._unshare.kill()
        self._unshare.wait()
        raise RuntimeError(f"{self.name} does not start; this needs root, and a kernel with namespaces")

    def start(self, *command: str, log: str) -> subprocess.Popen[bytes]:
        """Starts a program there, whose words go into a file of the folder."""
        enter = ["nsenter", f"--target={self.pid}", "--all", f"--wd={os.getcwd()}", "--"]
        with open(self.folder / f"{self.name}-{log}.log", "ab") as file:
            return subprocess.Popen([*enter, *command], stdout=file, stderr=subprocess.STDOUT)

    def run(self, *command: str, log: str) -> None:
        """Runs a program there to its end.

        Raises:
          subprocess.CalledProcessError: if it fails.
        """
        if status := self.start(*command, log=log).wait():
            raise subprocess.CalledProcessError(status, command)

    def said(self, log: str) -> str:
        """What a program has printed."""
        return (self.folder / f"{self.name}-{log}.log").read_text()

    def kill(self) -> None:
        """Ends it as a power cut does."""
        if self._unshare.poll() is None:
            os.kill(self.pid, signal.SIGKILL)
            self._unshare.wait()


class Pair:
    """Two machines with a cable between them; within ``with``, at whose end they are switched off.

    Args:
      folder: on the disk that they share, for what their programs print.
    """

    def __init__(self, folder: Path) -> None:
        self.one, self.two = (Host(name, folder) for name in ADDRESSES)
        self._connect()

    def _connect(self) -> None:
        subprocess.run(["ip", "link", "add", "to-two", "type", "veth", "peer", "name", "to-one"], check=True)
        for host, end in ((self.one, "to-two"), (self.two, "to-one")):
            subprocess.run(["ip", "link", "set", end, "netns", str(host.pid)], check=True)
            for command in (f"ip address add {host.address}/24 dev {end}", f"ip link set {end} up"):
                host.run(*command.split(), log="cable")

    def restart_two(self) -> None:
        """Switches the second one off, as a power cut does, and on again, with nothing running on it."""
        self.two.kill()
        self.two = Host(self.two.name, self.two.folder)
        self._connect()

    def __enter__(self) -> Pair:
        return self

    def __exit__(self, *_: object) -> None:
        self.one.kill()
        self.two.kill()
