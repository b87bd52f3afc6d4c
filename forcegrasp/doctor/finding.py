"""What a check has found."""

from __future__ import annotations

import dataclasses

#: How bad a finding is, from best to worst. Only the last keeps forcegrasp from working.
LEVELS = ("fine", "note", "warning", "mend")


@dataclasses.dataclass(frozen=True)
class Finding:
    """One line of the doctor's."""

    level: str  #: one of :data:`LEVELS`
    about: str  #: what was looked at, in a word or two
    text: str  #: what was found
    remedy: str = ""  #: what to do, if there is something to do

    def __post_init__(self) -> None:
        if self.level not in LEVELS or (self.level in LEVELS[2:] and not self.remedy):
            raise ValueError(f"not a finding: {self}")

    def line(self) -> str:
        """The finding as it is printed."""
        told = f"{self.text}; {self.remedy}" if self.remedy else self.text
        return f"  {self.level:<9}{self.about:<14}{' '.join(told.split())}"


def fine(about: str, text: str) -> Finding:
    """All is well."""
    return Finding("fine", about, text)


def note(about: str, text: str, remedy: str = "") -> Finding:
    """Good to know."""
    return Finding("note", about, text, remedy)


def warning(about: str, text: str, remedy: str) -> Finding:
    """Works, but not as well as it could."""
    return Finding("warning", about, text, remedy)


def mend(about: str, text: str, remedy: str) -> Finding:
    """Does not work as it is."""
    return Finding("mend", about, text, remedy)
