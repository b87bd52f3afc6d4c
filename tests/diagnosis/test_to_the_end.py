"""A fit to the end starts elsewhere only where that may help."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any, cast

import pytest

from forcegrasp.diagnosis.search import to_the_end as module
from forcegrasp.diagnosis.search.to_the_end import to_the_end


@dataclasses.dataclass
class Asked:
    """Stands for a study that is asked whether what the set gives explains a fit."""

    explains: bool
    target: str = "target"
    simulators: str = "simulators"
    fits: list[Any] = dataclasses.field(default_factory=list)

    def given_explains(self, _target: Any, fit: Any) -> bool:
        self.fits.append(fit)
        return self.explains


@pytest.mark.parametrize(
    ("error", "explains", "elsewhere"), [(1.2, False, True), (1.2, True, False), (1.04, False, False)]
)
def test_what_the_set_gives_asks_for_no_other_start(error, explains, elsewhere, monkeypatch):
    rough, exact = (SimpleNamespace(problem=None, vector=None, jacobian=None) for _ in range(2))
    led = []
    monkeypatch.setattr(module, "fit_exactly", lambda *_: exact)
    monkeypatch.setattr(module, "look_beside", lambda fit, *_: fit)
    monkeypatch.setattr(module, "rms_error", lambda *_: error if not led else 1.0)
    monkeypatch.setattr(module, "fit_led_by_others", lambda fit, *_: led.append(fit) or fit)
    study = Asked(explains)
    assert to_the_end(cast(Any, rough), cast(Any, study)) is exact
    assert led == ([exact] if elsewhere else [])
    assert study.fits == ([exact] if error > 1.05 else [])
