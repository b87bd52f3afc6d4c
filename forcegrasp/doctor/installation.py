"""Is forcegrasp itself installed as it should be, and whole?"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from importlib.metadata import Distribution
from importlib.resources import files
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

import forcegrasp
from forcegrasp.doctor.finding import Finding, fine, mend, warning
from forcegrasp.doctor.known_grasps import known_grasps
from forcegrasp.doctor.packages import installed

#: Files that the code reads, by package; some of each kind.
DATA = {
    "conf": ("train.yaml", "evaluate.yaml", "experiment/ib.yaml", "budget/quick.yaml"),
    "assets": ("known_grasps.json",),
    "reports": ("report.html", "view.js"),
}
AGAIN = "install it again: pip install . in a checkout, or make setup"


def check_installation() -> Iterator[Finding]:
    """That the code that runs is the code that is installed."""
    code, found = Path(forcegrasp.__file__).resolve().parent, installed("forcegrasp")
    if found is None:
        yield mend("forcegrasp", f"{code} runs without being installed, so that runs can't tell their versions", AGAIN)
        return
    home = home_of(found)
    if home and not code.is_relative_to(home):
        yield mend("forcegrasp", f"{home} is installed, but {code} runs", "unset PYTHONPATH, or leave that folder")
    elif found.version != forcegrasp.__version__:
        yield mend("forcegrasp", f"{forcegrasp.__version__} runs, but is installed as {found.version}", AGAIN)
    elif new := _newer(found, code.parent / "pyproject.toml"):
        told = f"pyproject.toml has changed since it was installed ({', '.join(sorted(new))})"
        yield warning("forcegrasp", told, "make setup, or: pip install --editable '.[dev,onnx]'")
    else:
        yield fine("forcegrasp", f"{found.version} in {code}")


def home_of(found: Distribution) -> Path | None:
    """The folder that a package runs from: its checkout if it is installed to be edited."""
    origin = json.loads(found.read_text("direct_url.json") or "{}")
    if origin.get("dir_info", {}).get("editable"):
        return Path(url2pathname(urlsplit(origin["url"]).path)).resolve()
    return Path(str(found.locate_file(""))).resolve()


def _newer(found: Distribution, pyproject: Path) -> set[str]:
    """Requirements of a checkout that its metadata does not have, or no longer should."""
    from packaging.requirements import Requirement

    if not pyproject.is_file():
        return set()
    asked = tomllib.loads(pyproject.read_text("utf-8"))["project"].get("dependencies", [])
    known = [r for r in map(Requirement, found.requires or []) if "extra" not in str(r.marker)]
    return {str(Requirement(text)) for text in asked} ^ {str(r) for r in known}


def needed_files() -> dict[str, tuple[str, ...]]:
    """:data:`DATA`, with scene and description of each gripper that comes with the package."""
    try:
        grippers = known_grasps()
    except (OSError, ValueError):
        return DATA
    own = (f"{name}{suffix}" for name in grippers for suffix in (".xml", ".yaml"))
    return {**DATA, "assets": (*DATA["assets"], *own)}


def check_data() -> Iterator[Finding]:
    """That presets, grippers, report and policies came with the code."""
    needed = needed_files()
    lost = [f"{package}/{name}" for package, names in needed.items() for name in names if not _is_there(package, name)]
    if lost:
        yield mend("files", f"missing in the package: {', '.join(lost)}", AGAIN)
    policies = [e.name for e in files("forcegrasp.policies").iterdir() if (e / "config.yaml").is_file()]
    if not policies:
        yield warning("files", "no trained policy came with the package", "train one: forcegrasp train budget=quick")
    if policies and not lost:
        yield fine("files", f"presets, grippers and report; trained policies: {', '.join(sorted(policies))}")


def _is_there(package: str, name: str) -> bool:
    try:
        return (files(f"forcegrasp.{package}") / name).is_file()
    except ModuleNotFoundError:
        return False
