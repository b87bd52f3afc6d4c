"""Reads logs of servos in the formats that others publish them in, or by a map of their columns."""

from forcegrasp.importers.formats import FORMATS, mechanism_of, read_source, unlike
from forcegrasp.importers.recording import Recording

__all__ = ["FORMATS", "Recording", "mechanism_of", "read_source", "unlike"]
