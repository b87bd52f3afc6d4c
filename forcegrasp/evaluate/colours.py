"""Which colour a policy has: the same in every picture, whoever else is in it."""

from __future__ import annotations

from collections.abc import Iterable
from zlib import crc32

from matplotlib.colors import to_hex, to_rgb

#: Controllers, and policies that come with the package (Okabe and Ito's colours, distinct to the colour-blind).
KNOWN = {
    "recommended": "#7b2cbf",
    "ib": "#0072b2",
    "no_ib": "#d55e00",
    "no_rand": "#009e73",
    "force_pi": "#cc79a7",
    "catalogue": "#117733",
    "ib_virtual_robot": "#e69f00",
    "ib_virtual_robot_measured": "#56b4e9",
    "informed": "#999933",
    "close": "#777777",
    "nothing": "#bbbbbb",
}
#: Of all other names, each has its place among these.
OTHERS = ("#6a5acd", "#b22222", "#8c6d31", "#003f6b", "#aa4499", "#ddcc77")


def policy_colours(names: Iterable[str]) -> dict[str, str]:
    """Name → colour. It follows from the name alone, unless two names of one picture would share theirs."""
    wanted = sorted(set(names))
    found = {name: KNOWN[name] for name in wanted if name in KNOWN}
    for name in wanted:
        if name in found:
            continue
        first = crc32(name.encode()) % len(OTHERS)
        own = (*OTHERS[first:], *OTHERS[:first])
        found[name] = next((c for c in (*own, *KNOWN.values()) if c not in found.values()), own[0])
    return found


def finger_colours(colour: str) -> tuple[str, str]:
    """Colours of the left and the right finger of a policy: its own, and a darker shade of it."""
    red, green, blue = to_rgb(colour)
    return colour, to_hex((red / 2, green / 2, blue / 2))
