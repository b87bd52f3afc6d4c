"""A sweep on two machines by SLURM: the same as run after run, also if a machine dies or a job is preempted."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from tools.two_hosts.hosts import ADDRESSES, Host, Pair
from tools.two_hosts.runs import BATCHES, OPTIONS, last_line, same_end, wait_for_batches, yes

SEEDS = 4
RUNS = [f"ib_s{seed}_{seed}" for seed in range(SEEDS)]
#: One job at a time on each machine. A machine that is silent for ten seconds is given up, and its jobs begin anew.
CONFIG = """
ClusterName=two
SlurmctldHost=one({one})
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CredType=cred/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SlurmdParameters=config_overrides
ReturnToService=2
SlurmdTimeout=10
JobRequeue=1
StateSaveLocation=/run/slurmctld
SlurmdSpoolDir=/run/slurmd
SlurmctldPidFile=/run/slurmctld.pid
SlurmdPidFile=/run/slurmd.pid
NodeName=one NodeAddr={one} CPUs=1 RealMemory=8000
NodeName=two NodeAddr={two} CPUs=1 RealMemory=8000
PartitionName=cpu Nodes=one,two Default=YES MaxTime=INFINITE State=UP
"""
LAUNCHER = ["hydra/launcher=submitit_slurm", "hydra.launcher.partition=cpu", "hydra.launcher.timeout_min=30"]


def tries(hosts: Pair, folder: Path) -> Iterator[tuple[str, str]]:
    """Runs a sweep on the two machines; yields what was tried and what came of it."""
    _start_slurm(hosts, folder)
    hosts.one.run(*_sweep(folder / "plain"), log="plain")
    hosts.one.run(*_sweep(folder / "both", *LAUNCHER), log="both")
    yield (
        "a sweep whose runs are jobs on two machines ends as one run after another, bit for bit",
        _same(folder, "both"),
    )

    sweep = hosts.one.start(*_sweep(folder / "killed", *LAUNCHER), log="killed")
    for run in RUNS[:2]:  # one on each
        wait_for_batches(folder / "killed" / run, BATCHES // 2)
    hosts.restart_two()
    _start_node(hosts.two, folder)
    yield "a machine dies under its job and comes back", f"the waiting command ends with exit status {sweep.wait()}"
    yield "SLURM begins that job anew, it goes on, and the sweep ends as if undisturbed", _same(folder, "killed")

    sweep = hosts.one.start(*_sweep(folder / "ended", *LAUNCHER), log="ended")
    for run in RUNS[:2]:
        wait_for_batches(folder / "ended" / run, BATCHES // 2)
    hosts.one.run("scancel", "--user=root", log="scancel")
    hosts.one.run("pkill", "-INT", "-f", str(folder / "ended"), log="scancel")
    yield (
        "Ctrl-C ends the waiting, `scancel` the jobs",
        f"exit status {sweep.wait()}: `{last_line(hosts.one, 'ended', folder)}`",
    )
    hosts.one.run("forcegrasp", "train", "-m", f"resume={folder / 'ended'}", log="resumed")
    yield "`train -m resume=FOLDER` goes on with it, and it ends as if undisturbed", _same(folder, "ended")


def _start_slurm(hosts: Pair, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    _config(folder).write_text(CONFIG.format(**ADDRESSES))
    _key(folder).unlink(missing_ok=True)
    _key(folder).write_bytes(os.urandom(128))
    _key(folder).chmod(0o400)
    os.environ["SLURM_CONF"] = str(_config(folder))
    hosts.one.run("mkdir", "/run/slurmctld", log="slurm")
    _start_munge(hosts.one, folder)
    hosts.one.run("slurmctld", log="slurm")
    hosts.one.run("slurmd", "-N", hosts.one.name, log="slurm")
    _start_node(hosts.two, folder)


def _start_node(host: Host, folder: Path) -> None:
    _start_munge(host, folder)
    host.run("slurmd", "-N", host.name, log="slurm")


def _start_munge(host: Host, folder: Path) -> None:
    """What tells the machines that they belong together."""
    host.run("mkdir", "/run/munge", "/run/slurmd", log="slurm")
    files = [f"--{name}-file=/run/munge/{name}" for name in ("pid", "log", "seed")]
    host.run("munged", "--force", f"--key-file={_key(folder)}", *files, log="slurm")


def _config(folder: Path) -> Path:
    return folder / "slurm.conf"


def _key(folder: Path) -> Path:
    return folder / "munge.key"


def _same(folder: Path, name: str) -> str:
    return yes(all(same_end(folder / "plain" / run, folder / name / run) for run in RUNS))


def _sweep(path: Path, *options: str) -> list[str]:
    shutil.rmtree(path, ignore_errors=True)
    return [
        "forcegrasp",
        "train",
        "-m",
        f"seed={','.join(map(str, range(SEEDS)))}",
        *OPTIONS,
        *options,
        f"hydra.sweep.dir={path}",
    ]
