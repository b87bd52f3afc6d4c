"""Every option of import changes something."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from forcegrasp.cli.main import main
from forcegrasp.cli.options import leaves
from forcegrasp.config.verbs import ImportConfig
from tests.importers import test_formats as made

CASES: dict[str, Any] = {
    "source": "[other]", "out": "elsewhere", "format": "bam", "map": "map.yaml", "joints": "[Elbow]",
    "mechanism": "mine.yaml", "license": "none", "example": True,
}  # fmt: skip


@pytest.fixture
def logs(tmp_path, monkeypatch) -> Path:
    """Two recordings of one joint, a map that would read them, and a mechanism of one's own."""
    monkeypatch.chdir(tmp_path)
    for name, amount in (("log", 1.0), ("other", 0.5)):
        (tmp_path / name).mkdir()
        made.sage(tmp_path / name)
        file = tmp_path / name / "control.csv"
        file.write_text(file.read_text().replace("[0.1,", f"[{0.1 * amount},"))
    (tmp_path / "map.yaml").write_text("time: t\njoints: a\ncommand: c\nposition: p\n")
    for suffix in (".yaml", ".xml"):
        text = (made.ASSETS / f"so101_jaw{suffix}").read_text()
        (tmp_path / f"mine{suffix}").write_text(text.replace("name: so101_jaw", "name: mine"))
    return tmp_path


def imported(capsys, **values: Any) -> tuple:
    """The exit status, what was said, and what was written."""
    given = {"source": "[log]", "format": "sage", "joints": "[Jaw]", "out": "set"} | values
    status = main(["import", *(f"{name}={value}" for name, value in given.items())])
    said = capsys.readouterr()
    written = [path.read_bytes() for path in sorted(Path(given["out"]).glob("*"))]
    for path in Path(given["out"]).glob("*"):
        path.unlink()
    return status, said.out, said.err, written


def test_every_option_of_import_has_a_case():
    assert list(CASES) == [name for name, *_ in leaves(ImportConfig)]


@pytest.mark.parametrize("name", CASES)
def test_option_of_import(name, logs, capsys):
    plain = imported(capsys)
    assert plain[0] == 0, plain[2]
    assert imported(capsys) == plain != imported(capsys, **{name: CASES[name]})
