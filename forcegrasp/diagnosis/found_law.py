"""A law that a diagnosis proposes for what no effect explains."""

from __future__ import annotations

import re
from dataclasses import dataclass

from forcegrasp.effects.law import Law
from forcegrasp.identify.fit import Fit
from forcegrasp.models.model_file import Fitted


@dataclass(frozen=True, eq=False)
class FoundLaw:
    """A law that held-out grasps show."""

    law: type[Law]  #: with the fitted numbers as those that a fit starts from
    parameters: dict[str, Fitted]
    rivals: tuple[str, ...]  #: terms that the first one can't be told from
    error_before: float  #: held-out rms residual ÷ noise
    error_after: float
    share: float  #: of the held-out mean square beyond the noise, that it explains
    before: Fit
    after: Fit

    @property
    def equation(self) -> str:
        """The law with its fitted numbers."""
        text = self.law.formula
        for name, fitted in self.parameters.items():
            text = re.sub(rf"\b{name}\b", f"{fitted.value:.3g}", text)
        return text.replace("+ -", "− ")
