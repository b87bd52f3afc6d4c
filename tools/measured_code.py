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
_SAID = "Measured with"
_SENTENCE = re.compile(rf"^{_SAID} .*$", re.MULTILINE)


def stamp() -> dict[str, str]:
    """Commit and digest of the code as it is, to be kept with each result."""
    return {"commit": git_hash() or "none", "digest": digest()}


def digest(root: Path = ROOT / "forcegrasp") -> str:
    """Twelve digits that change with any line of the packages: a commit says little of a tree with changes."""
    found = hashlib.sha256()
    for path in sorted(path for package in PACKAGES for path in (root / package).rglob("*.py")):
        found.update(f"{path.relative_to(root).as_posix()} {path.stat().st_size}\n".encode() + path.read_bytes())
    return found.hexdigest()[:12]


def sentences(rows: Iterable[dict]) -> list[str]:
    """For the page: which code its results are of."""
    counted = Counter((row.get("commit", ""), row.get("digest", "")) for row in rows)
    return [
        f"{_SAID} commit `{commit[:12]}{'+' * commit.endswith('+')}`, digest `{of_code}`: {sets} sets."
        if of_code
        else f"{_SAID} code that was not noted: {sets} sets."
        for (commit, of_code), sets in counted.most_common()
    ]


def outdated(page: str, now: str) -> list[str]:
    """The sentences of a page that are not of the code with this digest; if it has none, one that says so."""
    said = _SENTENCE.findall(page) or ["It does not say which code it measured."]
    return [line for line in said if f"digest `{now}`" not in line]
