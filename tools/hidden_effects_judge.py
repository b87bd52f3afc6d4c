"""Whether a diagnosis of the campaign was right, by what was hidden in the set."""

from __future__ import annotations

from collections.abc import Collection

from forcegrasp.effects import catalogue

#: What the messy rig has in every set, beside what is hidden: to name it, or a form of it, is right.
OF_THE_MESS = (
    "encoder_bias",
    "force_gain_asymmetry",
    "smooth_friction",
    "coulomb_friction",
    "object_size",
    "force_bias",
)
#: Groups where whoever names the kind of effect is right.
BY_FAMILY = ("law", "contact")
#: Of effects outside the catalogue for which the library of terms has a law: where it acts, and what is in its term.
TERMS = {
    "motor_cogging": ("motor", ("sin(6.28319 * position / period",)),
    "eccentric_encoder": ("position", ("sin(6.28319 * position / period",)),
    "motor_fade": ("motor", ("memory(abs(command - position)",)),
    "directional_gain": ("motor", ("* abs(command - position)",)),
    "rough_guide": ("motor", ("velocity * exp(",)),
    "curved_force_gain": ("force", ("force * abs(force)", "force ** 3")),
    "tip_inertia": ("force", ("acceleration",)),
}


def families(names: Collection[str]) -> set[str]:
    """The kinds of these effects; names that are no effects are left out."""
    known = catalogue()
    return {known[name].family for name in names if name in known}


def is_of_set(name: str) -> bool:
    """Whether a name stands for a mistake of the set and not for an effect."""
    return name not in catalogue() or catalogue()[name].of_set


def steps_of(row: dict) -> list[list[str]]:
    """What was found one after the other, each with what it can't be told from; nothing where nothing is named."""
    named = row.get("effects", [])
    return [effects for _, effects in row.get("steps", []) if effects and effects[0] in named]


def judge(row: dict, right: set[str]) -> str:
    """One of "first", "in set", "wrong", "missed", "error"; "in set" is right, but not it alone.

    Args:
      row: a result of the campaign.
      right: names of the effects that were hidden, as the catalogue has them.
    """
    verdict, named, group = row["verdict"], row.get("effects", []), row["group"].removeprefix("servo ")
    if verdict in ("error", "not_fitted"):
        return "error" if verdict == "error" else "missed"
    if group == "spoiled":
        if verdict in ("data", "refused"):
            return "first"
        return "in set" if any(is_of_set(name) for name in named) else "wrong" if named else "missed"
    if group == "two mistakes":
        told = named_of(row, right)
        return "first" if told == right else "in set" if told else "wrong" if named else "missed"
    if group == "outside":
        return "first" if verdict == "unknown" else "wrong" if named else "missed"
    if group == "contact" and not right:
        return "first" if families(named) <= {"contact"} else "wrong"
    if not right and group != "messy":
        return "first" if verdict == "explained" else "missed" if verdict == "unknown" else "wrong"
    if group in ("two", "several", "messy"):
        return _judge_several(row, right)
    matches = families(right) if group in BY_FAMILY else right
    hits = [bool(matches & (families([name]) if group in BY_FAMILY else {name})) for name in named]
    if any(hits[:1]):
        return "first"
    return "in set" if verdict == "one_of" and any(hits) else "wrong" if named else "missed"


def has_right_term(row: dict) -> bool | None:
    """Whether the law that was proposed has the term of what was hidden; None where there is no such term."""
    if row["group"] != "outside" or row["hidden"][0] not in TERMS:
        return None
    (place, texts), law = TERMS[row["hidden"][0]], row.get("law") or {"place": "", "expression": ""}
    return law["place"] == place and any(text in law["expression"] for text in texts)


def settled(row: dict, right: set[str], how: str) -> bool | None:
    """Whether further grasps, chosen so, left one effect, the right one; None where the set was no right tie.

    Args:
      row: a result of the campaign.
      right: as in :func:`judge`.
      how: "proposed" or "chance".
    """
    if row["group"] != "tie" or row["verdict"] != "one_of" or not right & set(row["effects"]):
        return None
    last = (row["further"][how] or [{"verdict": "", "effects": []}])[-1]
    return last["verdict"] == "effect" and set(last["effects"]) == right


def _judge_several(row: dict, right: set[str]) -> str:
    hits, wrong = named_of(row, right), false_names(row, right)
    if hits == right:
        return "in set" if wrong else "first"
    return "in set" if hits else "wrong" if wrong else "missed"


def named_of(row: dict, right: set[str]) -> set[str]:
    """Those of the hidden effects, or mistakes of the set, that are named, alone or in a tie."""
    return right & {*row.get("faults", []), *(name for step in steps_of(row) for name in step)}


def false_names(row: dict, right: set[str]) -> list[str]:
    """What was named first in a step of which nothing is right."""
    allowed = right | set(OF_THE_MESS if row["group"] == "messy" else ())
    return [step[0] for step in steps_of(row) if not allowed & set(step)]
