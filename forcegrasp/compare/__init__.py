"""Fit, noise floor, diagnosis, advice, reports. ``forcegrasp.compare(...)`` is :func:`forcegrasp.api.compare`.

Python makes a package an attribute of the one that it lies in: a function of the same name would be gone after the
first import from here. Therefore the package itself can be called.
"""

import importlib
import inspect
import sys
from types import ModuleType
from typing import Any


class _CallablePackage(ModuleType):
    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Where a model fails; see :func:`forcegrasp.api.compare`."""
        return importlib.import_module("forcegrasp.api").compare(*arguments, **options)

    @property
    def __signature__(self) -> inspect.Signature:
        return inspect.signature(importlib.import_module("forcegrasp.api").compare)


sys.modules[__name__].__class__ = _CallablePackage
