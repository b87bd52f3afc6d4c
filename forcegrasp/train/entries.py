"""A step's entries without what a tensordict checks of them: that takes as long as all that transforms compute."""

from __future__ import annotations

from typing import Any

from tensordict import TensorDictBase
from tensordict.utils import NestedKey
from torch import Tensor


@TensorDictBase.register  # for what checks types at run time
class Entries(dict[NestedKey, Tensor]):
    """Tensors by key, nested ones by their path: what the transforms of this package ask of a tensordict, and no more.

    A test holds what these make of it to TorchRL's own collector, bit for bit.
    """

    def get(self, key: Any, default: Any = None) -> Any:
        """The entry, or the default, which a dictionary takes by its place alone."""
        return super().get(key, default)

    def set(self, key: NestedKey, value: Tensor) -> Entries:
        """Writes an entry; returns itself."""
        self[key] = value
        return self
