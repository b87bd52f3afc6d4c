"""Does what is published work? Builds sdist and wheel, installs the wheel, and runs every verb once, tiny.

    python tools/wheel_smoke.py [--keep FOLDER]

The wheel is built from the sdist, so that both must be whole. It is installed with the versions of constraints.txt into
an empty environment, which is then read-only. The verbs run in another folder, with nothing in their environment but a
path and an empty home: no display, and no network where the system lets a user go without (Linux); elsewhere a proxy
that is not there. Takes some minutes, most of them to install torch. Exit status: 0 if all went well.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: What is no source, at the top and anywhere.
MADE_HERE, MADE = ("runs", "build", "dist", "multirun"), ("*.egg-info", "__pycache__", ".*")
TINY = ["ppo.total_frames=24", "ppo.grasps=2", "grasp.steps=4", "ppo.hidden=[4]", "log.checkpoint_every=1"]
SMALL = ["trials=2", "kappas=1", "grasp.steps=4", "physics=fast"]
LIMIT_S = 900


@dataclasses.dataclass(frozen=True)
class Step:
    """One command, and what it must leave behind."""

    name: str
    command: list[str]
    leaves: tuple[str, ...] = ()
    #: Called before, with the working folder.
    prepare: Callable[[Path], None] = lambda folder: None
    #: A refusal that is in order, too: text of it.
    or_says: str = ""


def interrupt(folder: Path) -> None:
    """Takes a run's last checkpoints away, as if it had ended before them."""
    first, *later = sorted((folder / "run" / "checkpoints").glob("frames_*"))
    if not later:
        raise RuntimeError(f"{first} is the only checkpoint")
    for checkpoint in later:
        checkpoint.unlink()


DEPLOY = """
from forcegrasp.deploy import GraspController
controllers = GraspController.load("exported", gripper="tiago"), GraspController.load("hand", gripper="franka_hand")
for controller in (*controllers, GraspController.baseline(gripper="so101_gripper")):
    print(controller.contract)
"""
GYMNASIUM = "import gymnasium, forcegrasp; print(gymnasium.make('forcegrasp/Grasp-v0').reset(seed=0)[0].shape)"
FUNCTIONS = "import forcegrasp as fg; print(fg.load('set'), fg.report(fg.compare('set', 'model.yaml'), 'p'))"
TYPED = "from importlib.resources import files; print((files('forcegrasp') / 'py.typed').read_text())"
SHIPPED = f"""
from forcegrasp.cli.main import main
from forcegrasp.policies import shipped_policies
names = ",".join([*shipped_policies(), "force_pi"])
raise SystemExit(main(["evaluate", f"policies=[{{names}}]", *{SMALL}, "out=shipped"]))
"""
STEPS = [
    Step("doctor", ["forcegrasp", "doctor"]),
    Step("effects", ["forcegrasp", "effects"]),
    Step("effects NAME", ["forcegrasp", "effects", "backlash", "gripper=franka_hand"]),
    Step("completion", ["forcegrasp", "completion", "bash"]),
    Step("train", ["forcegrasp", "train", *TINY, "hydra.run.dir=run"], ("run/run.json", "run/metrics.csv")),
    Step("train resume=", ["forcegrasp", "train", "resume=run"], prepare=interrupt),
    Step("train -m", ["forcegrasp", "train", "-m", *TINY, "seed=0,1", "hydra.sweep.dir=sweep"], ("sweep/curves.png",)),
    Step("curves", ["forcegrasp", "curves", "sweep", "out=curves"], ("curves/curves.json",)),
    Step("evaluate", ["forcegrasp", "evaluate", "policies=[run,force_pi]", *SMALL, "out=e"], ("e/report.html",)),
    Step("evaluate shipped", ["python", "-c", SHIPPED], ("shipped/evaluation.json",)),
    Step("robot", ["forcegrasp", "robot", "7"], ("robot_7.yaml",)),
    Step("render", ["forcegrasp", "render", "policy=run", "steps=8", "out=g.gif"], ("g.gif",), or_says="no OpenGL"),
    Step("export", ["forcegrasp", "export", "run", "out=exported"], ("exported/policy.onnx",)),
    Step("export force_pi", ["forcegrasp", "export", "force_pi", "gripper=franka_hand", "out=hand"], ("hand",)),
    Step("deploy", ["python", "-c", DEPLOY]),
    Step("record", ["forcegrasp", "record", "out=set", "grasps=6", "objects=1", "effects=[force_bias]"], ("set",)),
    Step("import", ["forcegrasp", "import", "example=true", "out=servo"], ("servo/meta.yaml",)),
    Step("fit", ["forcegrasp", "fit", "data=set", "out=model.yaml"], ("model.yaml",)),
    Step("functions", ["python", "-c", FUNCTIONS], ("p/report.html",)),
    Step("compare", ["forcegrasp", "compare", "data=set", "model=model.yaml", "out=c"], ("c/report.html",)),
    Step(
        "diagnose",
        ["forcegrasp", "diagnose", "data=set", "model=model.yaml", "effects=[force_bias,force_drift]", "out=d"],
        ("d/report.html", "d/diagnosis.json"),
    ),
    Step(
        "add",
        ["forcegrasp", "add", "data=set", "model=model.yaml", "effect=force_bias", "out=better.yaml"],
        ("better.yaml",),
    ),
    Step("train model=", ["forcegrasp", "train", *TINY, "model=better.yaml", "hydra.run.dir=with_model"]),
    Step("gymnasium", ["python", "-c", GYMNASIUM]),
    Step("py.typed", ["python", "-c", TYPED]),
]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", type=Path, help="a new folder for all that is made; deleted if not given")
    if keep := parser.parse_args().keep:
        return smoke(keep.resolve())
    folder = Path(tempfile.mkdtemp(prefix="forcegrasp_wheel_")).resolve()
    try:
        return smoke(folder)
    finally:
        allow_writing(folder)
        shutil.rmtree(folder)


def smoke(folder: Path) -> int:
    """Builds, installs and runs all steps below a folder; returns the exit status."""
    programs = install(folder, build(folder))
    packages = next((folder / "venv").glob("lib/python*/site-packages"))
    forbid_writing(packages)
    before = contents(packages)
    (folder / "work").mkdir()
    (folder / "home").mkdir()
    results = []
    command = [programs / "python", "-P", "-c", "from forcegrasp.cli.main import VERBS; print(*VERBS)"]
    verbs = subprocess.run(command, cwd=folder / "work", capture_output=True, text=True, check=True).stdout.split()
    for step in [*STEPS, *(Step(f"{verb} --help", ["forcegrasp", verb, "--help"]) for verb in verbs)]:
        started = time.monotonic()
        failure = run(step, folder, programs)
        results.append((step.name, failure))
        print(f"{step.name:<20}{time.monotonic() - started:6.1f} s  {'failed' if failure else 'ok'}", flush=True)
        if failure:
            print("\n".join(f"    {line}" for line in failure.splitlines()), flush=True)
    untried = set(verbs) - {step.command[1] for step in STEPS if step.command[0] == "forcegrasp"}
    results += [(verb, "no step for it") for verb in untried]
    if contents(packages) != before:
        results.append(("site-packages", "changed while the verbs ran"))
    wrong = [f"{name}: {failure.splitlines()[-1]}" for name, failure in results if failure]
    print("\n".join([f"{len(results) - len(wrong)} of {len(results)} ok", *wrong]))
    return int(bool(wrong))


def build(folder: Path) -> Path:
    """Returns the wheel, made from the sdist, made from a copy of the checkout."""
    source, dist = folder / "source", folder / "dist"
    anywhere = shutil.ignore_patterns(*MADE)
    shutil.copytree(
        ROOT, source, ignore=lambda at, names: anywhere(at, names) | (set(MADE_HERE) if Path(at) == ROOT else set())
    )
    venv.create(folder / "builder", with_pip=True)
    python = folder / "builder" / "bin" / "python"
    dist.mkdir()
    subprocess.run([python, "-m", "pip", "install", "-q", "setuptools>=77"], check=True)
    make = f"from setuptools import build_meta; build_meta.build_sdist({str(dist)!r})"
    subprocess.run([python, "-c", make], cwd=source, stdout=subprocess.DEVNULL, check=True)
    (sdist,) = dist.glob("*.tar.gz")
    command = [python, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", dist, sdist]
    subprocess.run(command, check=True)
    (wheel,) = dist.glob("*.whl")
    print(f"built {sdist.name} ({sdist.stat().st_size >> 10} KiB), {wheel.name} ({wheel.stat().st_size >> 10} KiB)")
    return wheel


def install(folder: Path, wheel: Path) -> Path:
    """Installs the wheel into an empty environment; returns the folder of its programs."""
    started = time.monotonic()
    venv.create(folder / "venv", with_pip=True)
    programs = folder / "venv" / "bin"
    command = [programs / "python", "-m", "pip", "install", "-q", "-c", ROOT / "constraints.txt", f"{wheel}[onnx]"]
    subprocess.run(command, check=True)
    print(f"installed in {time.monotonic() - started:.0f} s")
    return programs


def run(step: Step, folder: Path, programs: Path) -> str:
    """Runs a step; returns why it failed, "" if it did not."""
    work = folder / "work"
    program, *arguments = step.command
    variables = {
        "PATH": f"{programs}{os.pathsep}/usr/bin{os.pathsep}/bin",
        "HOME": str(folder / "home"),
        "LANG": "C.UTF-8",
        **dict.fromkeys(("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"), "http://127.0.0.1:9"),
    }
    try:
        step.prepare(work)
        done = subprocess.run(
            [*without_network(), programs / program, *arguments],
            cwd=work,
            env=variables,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
            check=False,
        )
    except (OSError, RuntimeError, subprocess.TimeoutExpired) as error:
        return f"{type(error).__name__}: {error}"
    printed = done.stdout + done.stderr
    if step.or_says and step.or_says in printed:
        return ""
    if done.returncode:
        return "\n".join([*printed.splitlines()[-12:], f"exit status {done.returncode}"])
    missing = [name for name in step.leaves if not (work / name).exists()]
    return f"did not leave {', '.join(missing)}" if missing else ""


def without_network() -> list[str]:
    """What to put before a command, so that it has no network: a namespace of its own where users may have one."""
    command = ["unshare", "--map-root-user", "--net"]
    try:
        allowed = subprocess.run([*command, "true"], capture_output=True, check=False).returncode == 0
    except OSError:
        allowed = False
    return command if allowed else []


def contents(folder: Path) -> dict[Path, tuple[int, int]]:
    """Every file with its size and date."""
    return {path: (path.stat().st_size, path.stat().st_mtime_ns) for path in folder.rglob("*") if path.is_file()}


def forbid_writing(folder: Path) -> None:
    """Makes a folder read-only. It does not hinder root, hence the look at its contents afterwards."""
    for path in (folder, *folder.rglob("*")):
        if not path.is_symlink():
            path.chmod(path.stat().st_mode & ~(stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH))


def allow_writing(folder: Path) -> None:
    """Makes all folders below one deletable."""
    for path in (folder, *folder.rglob("*")):
        if path.is_dir() and not path.is_symlink():
            path.chmod(path.stat().st_mode | stat.S_IWUSR)


if __name__ == "__main__":
    sys.exit(main())
