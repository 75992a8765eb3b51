"""Matrix products on the fastest path that torch has, and a linear layer made of them.

On the CPU that path is oneDNN: at 24,300 x 128 by 128 x 128 it does 210 GFLOP/s a core in single precision where MKL,
which ``torch.nn.functional.linear`` takes, does 92 (an AMD EPYC with AVX-512, measured).

Both oneDNN and torch's layer above it keep what they prepared for a thousand sizes of every kind of product, some
0.7 MB apiece, and no two graphs have the same number of edges: training held 7.7 GB and grew. So they are told to keep
few, which they read from the environment at their first product; a value that is set there already stands.
"""

from __future__ import annotations

import os

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

SIZES_KEPT = "16"  # enough for those of one graph
for variable in ("ONEDNN_PRIMITIVE_CACHE_CAPACITY", "LRU_CACHE_CAPACITY"):
    os.environ.setdefault(variable, SIZES_KEPT)


def times(rows: Tensor, weight: Tensor, bias: Tensor | None = None, rectified: bool = False) -> Tensor:
    """``rows`` (M, k) times the transpose of ``weight`` (n, k), plus ``bias`` (n,), then a ReLU if ``rectified``.

    No gradient is recorded.
    """
    if has_fast_path(rows):
        last = "relu" if rectified else "none"
        return torch.ops.mkldnn._linear_pointwise(dense(rows), dense(weight), bias, last, [], "")
    product = torch.nn.functional.linear(rows, weight, bias)
    return product.relu_() if rectified else product


def add_product(total: Tensor, rows: Tensor, weight: Tensor) -> Tensor:
    """Add ``rows`` (M, k) times the transpose of ``weight`` (n, k) to ``total`` (M, n) in place."""
    if total.dtype == torch.float32 and has_fast_path(rows):
        return total.add_(times(rows, weight))
    return total.addmm_(rows, weight.t())


def weight_gradient(gradient: Tensor, rows: Tensor) -> Tensor:
    """The gradient (n, k) of a weight, from that of its product (M, n) and from its rows (M, k)."""
    if rows.dtype == torch.float32 and has_fast_path(rows):
        return times(gradient.t(), rows.t())
    return gradient.t() @ rows


def dense(matrix: Tensor) -> Tensor:
    """The matrix without gaps, by rows or by columns: with gaps oneDNN is a thousand times slower."""
    return matrix if matrix.is_contiguous() or matrix.t().is_contiguous() else matrix.contiguous()


def has_fast_path(rows: Tensor) -> bool:
    """Whether oneDNN multiplies these."""
    if rows.device.type != "cpu" or not torch.backends.mkldnn.is_available() or rows.numel() == 0:
        return False
    if rows.dtype == torch.bfloat16:
        return torch.ops.mkldnn._is_mkldnn_bf16_supported()
    return rows.dtype == torch.float32


class Linear(torch.autograd.Function):
    """A linear layer: ``torch.nn.functional.linear`` by the products above."""

    @staticmethod
    def forward(context: torch.autograd.function.FunctionCtx, rows: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
        """(M, k), (n, k), (n,) -> (M, n)."""
        context.save_for_backward(rows, weight)
        return times(rows, weight, bias)

    @staticmethod
    @once_differentiable
    def backward(
        context: torch.autograd.function.FunctionCtx, gradient: Tensor
    ) -> tuple[Tensor | None, Tensor | None, Tensor | None]:
        """Gradients in the rows, where asked for, and in weight and bias."""
        rows, weight = context.saved_tensors
        to_rows = times(gradient, weight.t()) if context.needs_input_grad[0] else None
        to_weight = weight_gradient(gradient, rows) if context.needs_input_grad[1] else None
        return to_rows, to_weight, gradient.sum(dim=0)
