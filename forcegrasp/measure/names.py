"""Names of columns and keys that are missing, unknown or there twice, all told at once."""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Sequence

from forcegrasp.measure.folder import show

# How similar an unknown name is to one that is not there: its misspelling, or what it may stand for.
_SAME, _SIMILAR = 0.85, 0.5
# So many unknown names are told.
_MOST = 8


def misfits(
    what: str, names: Sequence[str], required: Sequence[str], optional: Sequence[str], *, more: bool = False
) -> str:
    """What is wrong with names, in a line; "" if nothing is.

    Args:
      what: they are of: "column" or "key".
      names: that are there.
      required: that must be there.
      optional: that may be there.
      more: whether others may be there, if they are no misspelling of these, and none that is required is missing.
    """
    absent = [name for name in (*required, *optional) if name not in names]
    missing = [name for name in required if name not in names]
    twice = [name for name, times in Counter(names).items() if times > 1 and name]
    unknown = [name for name in dict.fromkeys(names) if name not in (*required, *optional)]
    meant = {name: _meant(name, absent, _SAME if more and not missing else _SIMILAR) for name in unknown}
    wrong = sorted(unknown, key=lambda name: not meant[name])
    if more and not missing:
        wrong = [name for name in wrong if meant[name] or not name]
    told = [f"{show(name, 30)}{meant[name]}" for name in wrong[:_MOST]]
    told += [f"{len(wrong) - _MOST} more"] * (len(wrong) > _MOST)
    lists = {f"missing {what}s": missing, f"{what}s twice": twice, f"unknown {what}s": told}
    problems = [f"{kind}: {', '.join(some)}" for kind, some in lists.items() if some]
    if wrong and not more and not all(meant[name] for name in wrong):
        problems.append(f"known: {', '.join((*required, *optional))}")
    todo = [word for word, some in (("add", missing), ("remove", twice), ("rename", wrong)) if some]
    return "; ".join([*problems, f"{' or '.join(todo)} them"]) if problems else ""


def _meant(name: str, absent: Sequence[str], alike: float) -> str:
    """The name that an unknown one was probably meant to be, as a question."""
    near = difflib.get_close_matches(name.strip().lower(), absent, n=1, cutoff=alike)
    return f" (did you mean {near[0]}?)" if near else ""
