"""Are the packages there that forcegrasp needs, in versions that work together, and can they be imported?

What is needed is read from the metadata of the installed forcegrasp, which has it from pyproject.toml.
"""

from __future__ import annotations

import importlib.metadata
import platform
import sys
from collections.abc import Iterator
from importlib.metadata import Distribution, PackageNotFoundError
from pathlib import Path
from typing import TYPE_CHECKING

from forcegrasp.doctor.child import run_python
from forcegrasp.doctor.finding import Finding, fine, mend, note, warning

if TYPE_CHECKING:
    from packaging.requirements import Requirement

#: Released together: each works with one or two versions of the others.
TORCH_FAMILY = ("torch", "tensordict", "torchrl")
#: What an extra is for.
EXTRAS = {
    "onnx": "forcegrasp export, and exported policies",
    "rosbag": "measurement sets from ROS bags",
    "ray": "training with the grasps simulated on several machines, collector=ray",
    "cluster": "sweeps on SLURM, hydra/launcher=submitit_slurm",
    "video": "forcegrasp render out=NAME.mp4",
    "warp": "physics=warp, grasps on a GPU",
}
#: Every module of another package that forcegrasp imports, but for those of extras.
MODULES = (
    "numpy",
    "scipy.optimize",
    "mujoco",
    "torch",
    "tensordict",
    "torchrl.envs",
    "gymnasium",
    "hydra",
    "omegaconf",
    "yaml",
    "polars",
    "pydantic",
    "pydantic_core",
    "safetensors.torch",
    "matplotlib.figure",
    "PIL.Image",
    "jaxtyping",
    "jinja2",
    "rich.console",
    "packaging.requirements",
    "tensorboard",
    "torch.utils.tensorboard",
)
#: What to do about MuJoCo.
AFRESH = "start from a fresh environment (make clean setup), as MuJoCo 4 can't be installed over MuJoCo 3"
#: Imports them one by one, the name first, lest a crash leave it untold.
_IMPORT_ALL = """
import importlib, sys
for name in sys.argv[1:]:
    print("\\n" + name, end="", flush=True)
    try:
        importlib.import_module(name)
    except Exception as error:
        print("", " ".join(f"{type(error).__name__}: {error}".split())[:200], sep="\\t", end="", flush=True)
"""


def installed(name: str) -> Distribution | None:
    """A package's metadata; None if it is not installed."""
    try:
        return importlib.metadata.distribution(name)
    except PackageNotFoundError:
        return None


def requirements(name: str, extra: str = "") -> list[Requirement]:
    """What a package needs on this machine; with an extra, what that adds."""
    from packaging.requirements import Requirement

    found = installed(name)
    needed = map(Requirement, (found.requires or []) if found else [])
    if extra:
        return [r for r in needed if r.marker and r.marker.evaluate({"extra": extra}) and "extra" in str(r.marker)]
    return [r for r in needed if not r.marker or r.marker.evaluate({"extra": ""})]


def trouble(requirement: Requirement) -> str:
    """What is wrong with the installed package, "" if nothing is."""
    found = installed(requirement.name)
    if found is None:
        return f"{requirement.name} is not installed"
    if not requirement.specifier.contains(found.version, prereleases=True):
        return f"{requirement.name} {found.version} is installed, {requirement.specifier} is needed"
    return ""


def check_python() -> Iterator[Finding]:
    """The interpreter and the system."""
    from packaging.specifiers import SpecifierSet

    found = installed("forcegrasp")
    needed = (found.metadata["Requires-Python"] if found else None) or ">=3.11"
    told = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    if not SpecifierSet(needed).contains(platform.python_version(), prereleases=True):
        yield mend("Python", f"{told}, {needed} is needed", "make a new environment with a newer Python")
    elif sys.platform not in ("linux", "darwin"):
        yield warning("Python", told, "it is tested on Linux and macOS alone: run the tests before you trust it")
    else:
        yield fine("Python", f"{told}, as needed ({needed})")


def check_requirements() -> Iterator[Finding]:
    """Versions against what forcegrasp needs, and what the packages that it needs want of each other."""
    if installed("forcegrasp") is None:
        return  # another check tells
    needed = [r for r in requirements("forcegrasp") if r.name not in (*TORCH_FAMILY, "mujoco")]
    wrong = {r.name: mend(r.name, text, f"pip install '{r}'") for r in needed if (text := trouble(r))}
    for name in [r.name for r in requirements("forcegrasp")]:
        for r in requirements(name):
            text = trouble(r)
            if text and r.name not in (*wrong, *TORCH_FAMILY) and not r.name.startswith("mujoco"):
                wrong[r.name] = mend(r.name, f"{text} (for {name})", f"pip install '{r}'")
    yield from wrong.values()
    if not wrong:
        yield fine("packages", f"{len(needed)} others in the versions that are needed")


def check_torch_family() -> Iterator[Finding]:
    """The torch packages: a wrong pair fails when it is imported, or worse, later."""
    needed = [r for r in requirements("forcegrasp") if r.name in TORCH_FAMILY]
    wrong = [text for r in needed if (text := trouble(r))]
    for name in TORCH_FAMILY:
        wants = [str(r) for r in requirements(name) if r.name in TORCH_FAMILY and trouble(r)]
        wrong += [f"{name} wants {', '.join(wants)}"] * bool(wants)
    versions = [f"{name} {found.version}" for name in TORCH_FAMILY if (found := installed(name))]
    if wrong:
        together = " ".join(f"'{r}'" for r in needed)
        known = f"{', '.join(versions)} do not work together: " if len(versions) == len(TORCH_FAMILY) else ""
        yield mend("torch", f"{known}{', '.join(wrong)}", f"install them together: pip install {together}")
    else:
        yield fine("torch", f"{', '.join(versions)}, which belong together")


def check_mujoco() -> Iterator[Finding]:
    """MuJoCo, which is split in three since 4.0: pip removes files of the new parts with the old whole."""
    needed = next((r for r in requirements("forcegrasp") if r.name == "mujoco"), None)
    found, core = installed("mujoco"), installed("mujoco-core")
    if found is None:
        yield mend("MuJoCo", "not installed", f"pip install '{needed or 'mujoco'}'")
    elif needed and (text := trouble(needed)):
        old = found.version.startswith(("2.", "3."))
        yield mend("MuJoCo", text, AFRESH if old else f"pip install '{needed}'")
    elif core is None:
        yield mend("MuJoCo", f"mujoco is {found.version}, but its part mujoco-core is not installed", AFRESH)
    elif core.version != found.version:
        same = " ".join(f"'{part}=={found.version}'" for part in ("mujoco", "mujoco-core", "mujoco-studio"))
        yield mend("MuJoCo", f"mujoco is {found.version}, but mujoco-core {core.version}", f"pip install {same}")
    elif lost := [file for file in core.files or [] if file.suffix != ".pyc" and not Path(file.locate()).exists()]:
        told = f"{len(lost)} files of mujoco-core are missing ({lost[0].name}, …), as after an upgrade from 3.x"
        yield mend("MuJoCo", told, AFRESH)
    else:
        yield fine("MuJoCo", f"{found.version}, all parts there")


def check_imports() -> Iterator[Finding]:
    """Imports everything, in a process of its own."""
    child = run_python("-c", _IMPORT_ALL, *MODULES)
    tried = [line.partition("\t") for line in child.output.strip().splitlines()]
    wrong = [(name, error) for name, _, error in tried if error]
    if child.failure:
        wrong.append((tried[-1][0] if tried else "python", child.failure))
    absent = [name for name, error in wrong if error.endswith(f"No module named '{name.partition('.')[0]}'")]
    if absent:
        yield mend("imports", f"not there: {', '.join(absent)}", "install what is missing, or make a new environment")
    for error in dict.fromkeys(error for name, error in wrong if name not in absent):
        names = ", ".join(name for name, its_error in wrong if its_error == error)
        yield mend("imports", f"{names} can't be imported ({error})", "mend its version, or make a new environment")
    if not wrong:
        yield fine("imports", f"all {len(MODULES)} modules can be imported")


def check_extras() -> Iterator[Finding]:
    """What is not needed, but useful."""
    for extra, purpose in EXTRAS.items():
        needed = requirements("forcegrasp", extra)
        wrong = [text for r in needed if (text := trouble(r))]
        if not needed:
            yield note(extra, f"the installed forcegrasp does not know it ({purpose})", "install forcegrasp again")
        elif wrong:
            told = f"for {purpose}: {', '.join(wrong)}"
            yield note(extra, told, f"if you want it: pip install 'forcegrasp[{extra}]'")
        else:
            yield fine(extra, f"for {purpose}")
