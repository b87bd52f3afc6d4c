"""Nothing that forcegrasp reads can run code: no pickle, no eval, no object named in a file."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "forcegrasp"
SOURCES = sorted(PACKAGE.rglob("*.py"))
FORBIDDEN_MODULES = {"pickle", "_pickle", "dill", "cloudpickle", "shelve", "marshal", "joblib", "jsonpickle", "code"}
FORBIDDEN_NAMES = {"eval", "exec", "compile", "__import__"}
FORBIDDEN_CALLS = {
    "torch.load",
    "torch.save",
    "torch.jit.load",
    "yaml.load",
    "yaml.full_load",
    "yaml.unsafe_load",
    "os.system",
    "hydra.utils.instantiate",
    "hydra.utils.get_class",
    "pandas.read_pickle",
}


def dotted(node: ast.AST) -> str:
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def loads_text_only(call: ast.Call, tree: ast.AST) -> bool:
    """Whether yaml.load is given a loader of the same file that is one of YAML's own safe ones but for its refusals."""
    loaders = [dotted(k.value) for k in call.keywords if k.arg == "Loader"]
    classes = [node for node in ast.walk(tree) if isinstance(node, ast.ClassDef) and node.name in loaders]
    safe = {("yaml.BaseLoader",), ("yaml.SafeLoader",)}
    return len(classes) == 1 and tuple(map(dotted, classes[0].bases)) in safe


def offences(text: str) -> Iterator[str]:
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            module = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names = module + [f"{'.'.join([*module, ''])}{alias.name}" for alias in node.names]
            yield from (name for name in names if name.split(".")[0] in FORBIDDEN_MODULES or name in FORBIDDEN_CALLS)
        if isinstance(node, ast.Call):
            name = dotted(node.func)
            if name == "yaml.load" and loads_text_only(node, tree):
                continue
            if name in FORBIDDEN_NAMES or name in FORBIDDEN_CALLS:
                yield name
            if name.endswith(("np.load", "numpy.load")):
                safe = any(k.arg == "allow_pickle" and getattr(k.value, "value", 1) is False for k in node.keywords)
                if not safe:
                    yield name
            if any(k.arg == "shell" for k in node.keywords):
                yield f"{name}(shell=)"
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and "_target_" in node.value:
            yield "_target_"


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_source(path):
    assert not list(offences(path.read_text()))


@pytest.mark.parametrize(
    "text",
    [
        "import pickle",
        "from pickle import loads",
        "import joblib as j",
        "torch.load(path)",
        "from torch import load",
        "eval('1')",
        "np.load(p)",
        "np.load(p, allow_pickle=True)",
        "yaml.load(text)",
        "yaml.load(text, Loader=yaml.Loader)",
        "class Mine(yaml.UnsafeLoader): ...\nyaml.load(text, Loader=Mine)",
        "class Mine(yaml.BaseLoader, yaml.Loader): ...\nyaml.load(text, Loader=Mine)",
        "subprocess.run('ls', shell=True)",
        "x = {'_target_': 'os.system'}",
        "from hydra.utils import instantiate",
    ],
)
def test_the_scan_finds(text):
    assert list(offences(text))


def test_configs_name_no_object():
    for path in sorted((PACKAGE.parent / "conf").rglob("*.yaml")):
        text = path.read_text()
        assert "_target_" not in text
        assert "!!python" not in text
        assert "oc.env" not in text
