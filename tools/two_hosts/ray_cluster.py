"""One training on two machines by Ray: the same as on one, what it costs, and what becomes of it if a machine dies."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from tools.two_hosts.hosts import Pair
from tools.two_hosts.runs import BATCHES, OPTIONS, last_line, same_end, seconds_collecting, wait_for_batches, yes

PORT = 6379
#: A worker with one core for each machine.
SHARED = ["collector=ray", "collector.workers=2", "collector.address=auto"]


def tries(hosts: Pair, folder: Path) -> Iterator[tuple[str, str]]:
    """Trains on the two machines; yields what was tried and what came of it."""
    _start_ray(hosts, folder / "home")
    ways = {"direct": ["physics.threads=2"], "alone": ["collector=ray", "collector.workers=2"], "both": SHARED}
    for name, options in ways.items():
        hosts.one.run(*_train(folder / name, *options), log=name)
    same = same_end(folder / "alone", folder / "both")
    yield "a training whose workers are on two machines ends as with both on one, bit for bit", yes(same)
    seconds = {name: seconds_collecting(folder / name) for name in ways}
    for name, text in (("alone", "two workers on one machine"), ("both", "one worker on each of two machines")):
        ratio = seconds[name] / seconds["direct"]
        yield f"time to collect with {text}, of that with `collector=direct` and two threads", f"{ratio:.2f}"

    training = hosts.one.start(*_train(folder / "cut", *SHARED), log="cut")
    wait_for_batches(folder / "cut", BATCHES // 2)
    hosts.restart_two()
    status = training.wait()
    yield "a machine dies in the middle of a training", f"exit status {status}: `{last_line(hosts.one, 'cut', folder)}`"
    _join(hosts)
    hosts.one.run("forcegrasp", "train", f"resume={folder / 'cut'}", log="resumed")
    yield (
        "resumed with another machine in its place, it ends as if undisturbed, bit for bit",
        yes(same_end(folder / "both", folder / "cut")),
    )


def _train(path: Path, *options: str) -> list[str]:
    shutil.rmtree(path, ignore_errors=True)
    return ["forcegrasp", "train", *OPTIONS, *options, f"hydra.run.dir={path}"]


def _start_ray(hosts: Pair, home: Path) -> None:
    """As docs/cluster.md says, with a home of its own for the secret that both machines share."""
    home.mkdir(parents=True, exist_ok=True)
    os.environ |= {"HOME": str(home), "RAY_AUTH_MODE": "token"}
    one = hosts.one
    one.run("ray", "get-auth-token", "--generate", log="token")
    head = ["--head", f"--port={PORT}", f"--node-ip-address={one.address}", "--include-dashboard=false"]
    one.run("ray", "start", *head, "--num-cpus=1", "--disable-usage-stats", log="ray")
    _join(hosts)


def _join(hosts: Pair) -> None:
    two = hosts.two
    two.run(
        "ray",
        "start",
        f"--address={hosts.one.address}:{PORT}",
        f"--node-ip-address={two.address}",
        "--num-cpus=1",
        log="ray",
    )
