"""The errors to plant, as lists/ has them: a file per package, short enough to read.

```
forcegrasp/physics/plant.py | tests/physics/test_reference.py tests/golden     a file; tests that should notice
- self._sign = 1.0                                                             what stands there, exactly once
+ self._sign = -1.0                                                            what is planted; nothing removes it
```
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

LISTS = Path(__file__).parent / "lists"


@dataclass(frozen=True)
class Error:
    """One error to plant."""

    file: str  #: in the checkout, as a path from its root
    right: str  #: text of one line
    wrong: str
    tests: tuple[str, ...]  #: files and folders of tests, the quick and likely ones

    def __str__(self) -> str:
        return f"{self.file}: {self.right} → {self.wrong or '(nothing)'}"

    def problem(self, root: Path) -> str:
        """Why it can't be planted any more, since the code has changed; empty if it can."""
        path = root / self.file
        if not path.is_file():
            return "no such file"
        count = path.read_text("utf-8").count(self.right)
        if count != 1:
            return f"stands there {count} times"
        missing = [test for test in self.tests if not (root / test).exists()]
        return f"no {missing[0]}" if missing else ""


def read_lists(folder: Path = LISTS) -> list[Error]:
    """All errors, in the order of the lists.

    Raises:
      ValueError: names the list and the line that is none of the three kinds.
    """
    return [error for path in sorted(folder.glob("*.txt")) for error in _read(path)]


def _read(path: Path) -> list[Error]:
    errors: list[Error] = []
    file, tests, right = "", (), None
    for number, line in enumerate(path.read_text("utf-8").splitlines(), 1):
        mark, text = line[:1], line[1:].strip()
        if mark == "#" or not line.strip():
            continue
        if mark == "-" and file and right is None and text:
            right = text
        elif mark == "+" and right is not None and text != right:
            errors.append(Error(file, right, text, tests))
            right = None
        elif " | " in line and right is None:
            file, _, named = line.partition(" | ")
            tests = tuple(named.split())
        else:
            raise ValueError(f"{path.name}, line {number}: {line!r} is neither FILE | TESTS, - TEXT nor + TEXT")
    return errors
