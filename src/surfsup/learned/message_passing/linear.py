"""Linear layers on torch's fastest path.

On a CPU that path is oneDNN. For 24,300 x 128 by 128 x 128 in single precision it reaches 210 GFLOP/s on a core of an
AMD EPYC with AVX-512; MKL, which ``torch.nn.functional.linear`` uses, reaches 92.

oneDNN and torch's layer above it cache what they prepare for each of the last 1,024 matrix sizes, about 0.7 MB a size.
The number of edges differs in every graph, so training held 7.7 GB and grew. This module limits both caches by
environment variables, which torch reads at the first product. A value that the user has set stays.
"""

from __future__ import annotations

import os
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

CACHED_SIZES = "16"  # enough for the products of one graph
for variable in ("ONEDNN_PRIMITIVE_CACHE_CAPACITY", "LRU_CACHE_CAPACITY"):
    os.environ.setdefault(variable, CACHED_SIZES)


def linear(rows: Tensor, weight: Tensor, bias: Tensor | None = None, relu: bool = False) -> Tensor:
    """``rows`` (M, k) times the transpose of ``weight`` (n, k), plus ``bias`` (n,), then a ReLU if ``relu``.

    No gradient is recorded.
    """
    if has_onednn(rows):
        activation = "relu" if relu else "none"
        return torch.ops.mkldnn._linear_pointwise(without_gaps(rows), without_gaps(weight), bias, activation, [], "")
    product = torch.nn.functional.linear(rows, weight, bias)
    return product.relu_() if relu else product


def add_linear_(total: Tensor, rows: Tensor, weight: Tensor) -> Tensor:
    """Add ``rows`` (M, k) times the transpose of ``weight`` (n, k) to ``total`` (M, n) in place."""
    if total.dtype == torch.float32 and has_onednn(rows):
        return total.add_(linear(rows, weight))
    return total.addmm_(rows, weight.t())


def weight_gradient(gradient: Tensor, rows: Tensor) -> Tensor:
    """The gradient (n, k) of a weight, from the gradient (M, n) of its product and the rows (M, k)."""
    if rows.dtype == torch.float32 and has_onednn(rows):
        return linear(gradient.t(), rows.t())
    return gradient.t() @ rows


def without_gaps(matrix: Tensor) -> Tensor:
    """The matrix contiguous by rows or by columns. With gaps oneDNN is a thousand times slower."""
    return matrix if matrix.is_contiguous() or matrix.t().is_contiguous() else matrix.contiguous()


def has_onednn(rows: Tensor) -> bool:
    """Whether oneDNN multiplies matrices of this size, type and device."""
    if rows.device.type != "cpu" or not torch.backends.mkldnn.is_available() or rows.numel() == 0:
        return False
    if rows.dtype == torch.bfloat16:
        return torch.ops.mkldnn._is_mkldnn_bf16_supported()
    return rows.dtype == torch.float32


class Linear(torch.autograd.Function):
    """``torch.nn.functional.linear`` by the products above."""

    @staticmethod
    def forward(ctx: Any, rows: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
        """(M, k), (n, k), (n,) -> (M, n)."""
        ctx.save_for_backward(rows, weight)
        return linear(rows, weight, bias)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, Tensor | None, Tensor | None]:
        """Gradients of rows, weight and bias."""
        rows, weight = ctx.saved_tensors
        to_rows = linear(gradient, weight.t()) if ctx.needs_input_grad[0] else None
        to_weight = weight_gradient(gradient, rows) if ctx.needs_input_grad[1] else None
        return to_rows, to_weight, gradient.sum(dim=0)
