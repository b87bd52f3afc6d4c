"""The two machines that Ray and SLURM are tried on see each other, share the disk, and can be switched off."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time

import pytest

from tools.two_hosts.hosts import ADDRESSES, Pair

needed = ("unshare", "nsenter", "ip", "mount")
possible = os.geteuid() == 0 and all(map(shutil.which, needed))
if possible:
    possible = (
        subprocess.run(["unshare", "--net", "--mount", "--pid", "--fork", "true"], capture_output=True).returncode == 0
    )
pytestmark = pytest.mark.skipif(not possible, reason="needs root, and a kernel with namespaces")

ANSWER = """
import socket, sys
with socket.create_server((sys.argv[1], 5000)) as server:
    while True:
        server.accept()[0].sendall(socket.gethostname().encode())
"""
#: Not the one of a virtual environment, nor a script that looks for one: both may lie where the hosts see nothing.
PYTHON = os.path.realpath(sys.executable)
ASK = "import socket; print(socket.create_connection(('one', 5000), 5).recv(9).decode())"


def test_they_see_each_other_and_not_each_others_files(tmp_path):
    with Pair(tmp_path) as hosts:
        answering = hosts.one.start(PYTHON, "-c", ANSWER, ADDRESSES["one"], log="answer")
        hosts.two.run("sh", "-c", "hostname; touch /tmp/here; ls /tmp", log="own")
        assert hosts.two.said("own").split() == ["two", "here"]
        for _ in range(2):
            until = time.monotonic() + 20
            while hosts.two.start(PYTHON, "-c", ASK, log="ask").wait() and time.monotonic() < until:
                time.sleep(0.1)
            assert hosts.two.said("ask").split()[-1] == "one"
            hosts.restart_two()
            hosts.two.run("ls", "/tmp", log="anew")
            assert hosts.two.said("anew") == ""
        with pytest.raises(subprocess.CalledProcessError):
            hosts.two.run("false", log="own")
    assert answering.wait() != 0
