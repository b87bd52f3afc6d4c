"""The networks' hyperbolic tangent, by numpy: on one thread of a CPU torch's takes as long as a layer's product."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor, nn


class Tanh(nn.Tanh):
    """:class:`torch.nn.Tanh`, from whose results it differs in the last bits; torch's own wherever numpy's can't be."""

    def forward(self, input: Tensor) -> Tensor:
        """``(*B) -> (*B)``."""
        recorded = torch.compiler.is_compiling() or torch.jit.is_tracing()  # pyright: ignore[reportPrivateImportUsage]
        if recorded or input.device.type != "cpu":
            return super().forward(input)
        try:
            return _ByNumpy.apply(input) if torch.is_grad_enabled() and input.requires_grad else _tanh(input)
        except (RuntimeError, TypeError):  # within torch.func, or of a type that numpy lacks
            return super().forward(input)


def _tanh(x: Tensor) -> Tensor:
    return torch.from_numpy(np.tanh(x.detach().numpy()))


class _ByNumpy(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, x: Tensor) -> Tensor:
        y = _tanh(x)
        ctx.save_for_backward(y)
        return y

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> Tensor:
        return torch.ops.aten.tanh_backward(gradients[0], *ctx.saved_tensors)
