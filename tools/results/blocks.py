"""What stands on pages between marks: which table it is, and the stages that it comes from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tools.results import tables
from tools.results.policies import POLICIES

_CONTROLLERS = "evaluate-controllers"


@dataclass(frozen=True)
class Block:
    """A marked part of a page.

    Args:
      page: its path in the repository.
      name: in the mark; it may stand on several pages.
      stages: whose results it shows.
      text: makes it from the folder of results; None for pictures, whose lines stay.
      of_package: it shows the policies of the package, not all seeds.
    """

    page: str
    name: str
    stages: tuple[str, ...]
    text: Callable[[Path], str] | None = None
    of_package: bool = False


def _evaluated(*names: str) -> tuple[str, ...]:
    return (*(f"evaluate-{name}" for name in names), _CONTROLLERS)


_RESULTS, _ABLATIONS, _TRANSFER = "docs/results.md", "docs/ablations.md", "docs/transfer.md"
_ON_ROBOT = tuple(policy.name for policy in POLICIES if policy.name != "recommended")
BLOCKS = (
    Block(_RESULTS, "paper", _evaluated("ib", "no_ib", "no_rand"), tables.paper),
    Block(_RESULTS, "paper-softness", _evaluated("ib", "no_ib", "no_rand"), tables.paper_softness),
    Block(_RESULTS, "paper-pictures", ("pictures",), of_package=True),
    Block(_RESULTS, "force-reward-picture", ("pictures",), of_package=True),
    Block(_RESULTS, "users", _evaluated("recommended", "ib"), tables.users),
    Block(_RESULTS, "users-softness", _evaluated("recommended", "ib"), tables.users_softness),
    Block(_RESULTS, "users-pictures", ("pictures",), of_package=True),
    Block(_RESULTS, "traces-picture", ("pictures",), of_package=True),
    Block(_RESULTS, "printed", ("evaluate-printed",), tables.printed),
    Block(_ABLATIONS, "curves-picture", ("curves-picture",)),
    Block(_ABLATIONS, "ablation", ("evaluate-ablation",), tables.ablation),
    Block(_ABLATIONS, "parts", ("evaluate-parts",), tables.parts),
    Block(_TRANSFER, "transfer", _evaluated(*_ON_ROBOT), tables.transfer),
    Block(_TRANSFER, "transfer-objects", _evaluated(*_ON_ROBOT), tables.transfer_objects),
    Block(_TRANSFER, "transfer-picture", ("render-transfer",), of_package=True),
    Block("docs/robots.md", "robots", ("robots",), tables.robots, of_package=True),
    Block("docs/quickstart.md", "paper-pictures", ("pictures",), of_package=True),
)
