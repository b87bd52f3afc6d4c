"""Files and modules that pages and programs name exist, and all packages are listed in CONTRIBUTING.md."""

from __future__ import annotations

import importlib
import re

import pytest
from doc_pages import PAGES, ROOT

import forcegrasp

#: Paths from the checkout, without those of capital letters, which stand for a user's own name.
_PATH = re.compile(r"(?<![\w./-])(?:forcegrasp|tests|tools|conf|docs)/[a-z0-9_./*-]*[a-z0-9_*](?![A-Zα-ω\w…-])")
_MODULE = re.compile(r"\bforcegrasp(?:\.\w+)+")
#: Files that a page asks its reader to write.
_EXAMPLES = {
    "conf/experiment/blind.yaml",
    "conf/openings.yaml",
    "conf/sweep/blind.yaml",
    "forcegrasp/cli/openings.py",
    "forcegrasp/effects/sensor_curvature.py",
}
PROGRAMS = {path.relative_to(ROOT).as_posix(): path.read_text("utf-8") for path in sorted(ROOT.glob("tools/**/*.py"))}
TEXTS = PAGES | PROGRAMS


@pytest.mark.parametrize("name", TEXTS)
def test_paths_exist(name):
    missing = {path for path in _PATH.findall(TEXTS[name]) if not list(ROOT.glob(path))}
    assert missing <= _EXAMPLES


@pytest.mark.parametrize("name", TEXTS)
def test_modules_exist(name):
    missing = {dotted for dotted in _MODULE.findall(TEXTS[name]) if not exists(dotted)}
    assert missing <= {"forcegrasp.conf"}  # of the wheel: conf/ here


def exists(dotted: str) -> bool:
    """Whether a dotted name is a module, or something in one."""
    parts = dotted.split(".")
    found = importlib.import_module(parts[0])
    for end, part in enumerate(parts[1:], 2):
        if not hasattr(found, part):
            try:
                found = importlib.import_module(".".join(parts[:end]))
            except ImportError:
                return False
        else:
            found = getattr(found, part)
    return True


def test_all_packages_are_listed():
    page = PAGES["CONTRIBUTING.md"]
    listed = re.findall(r"^  (\w+(?:/|\.py)) ", page.split("```\nforcegrasp/")[1].split("conf/  ")[0], re.MULTILINE)
    there = {path.name + "/" for path in (ROOT / "forcegrasp").iterdir() if (path / "__init__.py").exists()}
    there |= {path.name for path in (ROOT / "forcegrasp").glob("[a-z]*.py")}
    assert sorted(listed) == sorted(there)


def test_no_module_hides_a_function():
    """Python makes an imported module an attribute of its package: fg.NAME would be the module from then on."""
    modules = {path.stem for path in (ROOT / "forcegrasp").iterdir()}
    assert not modules & set(forcegrasp.__all__)
