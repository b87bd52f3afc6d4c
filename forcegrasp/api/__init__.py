"""The verbs of the command line as functions: ``import forcegrasp as fg; fg.diagnose("my_set")``. No torch in here."""

from forcegrasp.api.functions import add, compare, diagnose, fit, load, report
from forcegrasp.reports.results import AddResult, CompareResult, DiagnoseResult, FitResult, Result, TableResult

__all__ = [
    "AddResult",
    "CompareResult",
    "DiagnoseResult",
    "FitResult",
    "Result",
    "TableResult",
    "add",
    "compare",
    "diagnose",
    "fit",
    "load",
    "report",
]
