"""The networks' tanh against torch's, forwards and backwards, and where numpy's can't be used."""

from __future__ import annotations

from typing import Any

import pytest
import torch
from torch import nn

from forcegrasp.controllers.tanh import Tanh


def values(dtype: torch.dtype = torch.float32) -> torch.Tensor:
    return torch.linspace(-12, 12, 4803, dtype=dtype).reshape(3, -1)


@pytest.mark.parametrize(("dtype", "within"), [(torch.float32, 2e-7), (torch.float64, 1e-15)])
def test_it_is_torchs_tanh(dtype, within):
    x = values(dtype)
    found, before = Tanh()(x), x.clone()
    assert found.dtype is dtype
    assert (found - nn.Tanh()(x)).abs().max() < within
    assert torch.equal(x, before)  # nothing is written where it is read


def test_its_gradient_is_that_of_tanh():
    x = values(torch.float64)[:, ::40].requires_grad_()
    assert torch.autograd.gradcheck(Tanh(), x)
    assert torch.autograd.gradgradcheck(Tanh(), x)


def test_no_gradient_is_kept_that_nobody_asks_for():
    x = values().requires_grad_()
    assert Tanh()(x).requires_grad
    assert not Tanh()(x.detach()).requires_grad
    with torch.no_grad():
        assert not Tanh()(x).requires_grad


def test_a_value_does_not_depend_on_its_neighbours():
    x = values()
    assert torch.equal(Tanh()(x)[1, 7:8], Tanh()(x[1, 7:8]))


@pytest.mark.parametrize(
    "call",
    [
        lambda net, x: torch.func.vmap(net)(x),
        lambda net, x: torch.func.grad(lambda each: net(each).sum())(x),
        lambda net, x: torch.func.jvp(net, (x,), (torch.ones_like(x),)),
        lambda net, x: net(x.bfloat16()),
        lambda net, x: torch.jit.trace(net, x[:1])(x),
        lambda net, x: torch.export.export(net, (x,)).module()(x),
    ],
    ids=["vmap", "grad", "jvp", "bfloat16", "trace", "export"],
)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_where_numpy_cant_be_used_it_is_torchs_own(call: Any):
    torch.testing.assert_close(call(Tanh(), values()), call(nn.Tanh(), values()))
