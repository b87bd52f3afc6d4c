"""Which code a page's figures were measured with: its commit, and a digest of the packages that they depend on."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from forcegrasp.runs.provenance import git_hash

ROOT = Path(__file__).resolve().parents[1]
#: Packages on which a diagnosis depends.
PACKAGES = ("identify", "diagnosis", "effects", "replay")
#: Commit and digest in the sentence of a page or a card.
STAMP = re.compile(r"commit `([0-9a-f]+\+?)`, digest `([0-9a-f]+)`")
#: What of a package can change a figure.
_SUFFIXES = (".py", ".yaml", ".xml", ".json")
_SAID = "Measured with"
_SENTENCE = re.compile(rf"^{_SAID} .*$", re.MULTILINE)


def stamp() -> dict[str, str]:
    """Commit and digest of the code as it is, to be kept with each result."""
    return {"commit": git_hash() or "none", "digest": digest()}


def digest(root: Path = ROOT / "forcegrasp", packages: Iterable[str] = PACKAGES) -> str:
    """Twelve digits that change with any line of the packages: a commit says little of a tree with changes.

    Args:
      root: where the packages lie; one that is not there lies beside it, as the presets of ``conf`` do.
      packages: their names, or those of single files.
    """
    found, files = hashlib.sha256(), {}
    for package in packages:
        top = root / package if (root / package).exists() else root.parent / package
        for path in [top] if top.is_file() else top.rglob("*"):
            if path.suffix in _SUFFIXES:
                files[Path(package, path.relative_to(top))] = path
    for name, path in sorted(files.items()):
        found.update(f"{name.as_posix()} {path.stat().st_size}\n".encode() + path.read_bytes())
    return found.hexdigest()[:12]


def sentence(commit: str, of_code: str, what: str) -> str:
    """For a page: which code measured what stands there."""
    if not of_code:
        return f"{_SAID} code that was not noted: {what}."
    return f"{_SAID} commit `{commit[:12]}{'+' * commit.endswith('+')}`, digest `{of_code}`: {what}."


def sentences(rows: Iterable[dict]) -> list[str]:
    """For the page: which code its results are of."""
    counted = Counter((row.get("commit", ""), row.get("digest", "")) for row in rows)
    return [sentence(commit, of_code, f"{sets} sets") for (commit, of_code), sets in counted.most_common()]


def without_sentences(text: str) -> str:
    """What a page says besides, without empty lines at its ends."""
    return _SENTENCE.sub("", text).strip("\n")


def outdated(page: str, now: str) -> list[str]:
    """The sentences of a page that are not of the code with this digest; if it has none, one that says so."""
    said = _SENTENCE.findall(page) or ["It does not say which code it measured."]
    return [line for line in said if f"digest `{now}`" not in line]
