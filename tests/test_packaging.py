"""Wheel and sdist carry all that the code reads; ``tools/wheel_smoke.py`` really builds and uses them."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from forcegrasp import __version__
from forcegrasp.cli.main import VERBS


@pytest.fixture(scope="module")
def project(root) -> dict:
    return tomllib.loads((root / "pyproject.toml").read_text("utf-8"))


def test_every_package_is_listed(project, root):
    listed = project["tool"]["setuptools"]["packages"]
    found = {".".join(path.parent.relative_to(root).parts) for path in (root / "forcegrasp").rglob("__init__.py")}
    assert sorted(listed) == sorted(found | {"forcegrasp.conf"})


def test_every_data_file_is_carried(project, root):
    places = project["tool"]["setuptools"]["package-dir"]
    carried: set[Path] = set()
    for package, patterns in project["tool"]["setuptools"]["package-data"].items():
        folder = root / places.get(package, package.replace(".", "/"))
        for pattern in patterns:
            assert "policies" in package or list(folder.glob(pattern)), f"{package}: nothing is {pattern}"
            carried |= set(folder.glob(pattern))
    there = {
        path
        for top in ("forcegrasp", "conf")
        for path in (root / top).rglob("*")
        if path.is_file() and path.suffix not in (".py", ".pyc") and not path.name.startswith(".")
    }
    assert there == carried


def test_what_is_said_of_it(project, root):
    about = project["project"]
    assert (root / about["readme"]).is_file()
    assert all((root / name).is_file() for name in about["license-files"])
    assert about["license"] in (root / "LICENSE").read_text()
    citation = yaml.safe_load((root / "CITATION.cff").read_text("utf-8"))
    assert citation["version"] == __version__
    assert f"## {__version__}" in (root / "CHANGELOG.md").read_text("utf-8")


def test_constraints_hold_every_requirement(project, root):
    lines = (root / "constraints.txt").read_text().split()
    versions = {canonicalize_name(name): version for name, version in (line.split("==") for line in lines)}
    extras = project["project"]["optional-dependencies"]
    of_extras = [text for name, texts in extras.items() if name != "dev" for text in texts]
    for text in [*project["project"]["dependencies"], *of_extras]:
        needed = Requirement(text)
        assert needed.specifier.contains(versions[canonicalize_name(needed.name)]), text


def test_the_smoke_test_runs_every_verb(root):
    text = (root / "tools" / "wheel_smoke.py").read_text("utf-8")
    assert not [verb for verb in VERBS if f'["forcegrasp", "{verb}"' not in text]


def test_links_of_the_pages_for_contributors(root):
    for page in ("CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md"):
        text = (root / page).read_text("utf-8")
        for target in re.findall(r"\]\(([^)#]+)", text):
            assert target.startswith("https:") or (root / target).exists(), f"{page}: {target}"
        for name in re.findall(r"`((?:forcegrasp|tests|tools|docs|conf)/[a-z_\d./]+)`", text):
            assert (root / name).exists(), f"{page}: {name}"
