"""The null effect: everything stays as it is. Stands where an effect could be and is not."""

from __future__ import annotations

from forcegrasp.effects.base import Effect


class NoEffect(Effect):
    """Changes nothing."""

    name = "none"
    stage = "sensor"
    family = "none"
    symptom = "nothing but sensor noise is left"
    formula = "y = x"
    source = "null member of the catalogue"
    parameters = ()
