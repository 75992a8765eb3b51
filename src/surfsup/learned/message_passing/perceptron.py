"""The paper's perceptron: two hidden layers, ReLU, layer normalization of what comes out."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.autograd.function import once_differentiable

from surfsup.learned.message_passing.products import Linear, times, weight_gradient


class Perceptron(nn.Module):
    """Linear, ReLU, linear, ReLU, linear, layer normalization; it computes in the precision of what goes in."""

    def __init__(self, inputs: int, width: int) -> None:
        super().__init__()
        self.first = nn.Linear(inputs, width)
        self.second = nn.Linear(width, width)
        self.third = nn.Linear(width, width)
        self.norm = nn.LayerNorm(width)

    def forward(self, rows: Tensor, precision: torch.dtype | None = None) -> Tensor:
        """(M, inputs) -> (M, width); after the first layer in ``precision``, which is else that of the rows."""
        weight, bias = self.first.weight.to(rows.dtype), self.first.bias.to(rows.dtype)
        return self.after_first(Linear.apply(rows, weight, bias).relu().to(precision or rows.dtype))

    def after_first(self, hidden: Tensor) -> Tensor:
        """The rest, from the first hidden layer (M, width), already rectified."""
        parameters = (
            self.second.weight,
            self.second.bias,
            self.third.weight,
            self.third.bias,
            self.norm.weight,
            self.norm.bias,
        )
        return AfterFirst.apply(hidden, *(parameter.to(hidden.dtype) for parameter in parameters), self.norm.eps)


class AfterFirst(torch.autograd.Function):
    """Linear, ReLU, linear, layer normalization in one, so that nothing is kept or copied that need not be."""

    @staticmethod
    def forward(
        context: torch.autograd.function.FunctionCtx,
        first: Tensor,
        second_weight: Tensor,
        second_bias: Tensor,
        third_weight: Tensor,
        third_bias: Tensor,
        scale: Tensor,
        shift: Tensor,
        eps: float,
    ) -> Tensor:
        """The first hidden layer (M, width) -> (M, width)."""
        second = times(first, second_weight, second_bias, rectified=True)
        third = times(second, third_weight, third_bias)
        out, mean, inverse_spread = torch.native_layer_norm(third, scale.shape, scale, shift, eps)
        context.save_for_backward(first, second, third, mean, inverse_spread, second_weight, third_weight, scale, shift)
        return out

    @staticmethod
    @once_differentiable
    def backward(context: torch.autograd.function.FunctionCtx, gradient: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients in the first hidden layer and in all parameters."""
        first, second, third, mean, inverse_spread, second_weight, third_weight, scale, shift = context.saved_tensors
        to_third, to_scale, to_shift = torch.ops.aten.native_layer_norm_backward(
            gradient.contiguous(), third, scale.shape, mean, inverse_spread, scale, shift, [True, True, True]
        )
        to_second = rectified_gradient_(times(to_third, third_weight.t()), second)
        to_first = times(to_second, second_weight.t())
        return (
            to_first,
            weight_gradient(to_second, first),
            to_second.sum(dim=0),
            weight_gradient(to_third, second),
            to_third.sum(dim=0),
            to_scale,
            to_shift,
            None,
        )


def rectified_gradient_(gradient: Tensor, out: Tensor) -> Tensor:
    """The gradient through a ReLU whose outcome was ``out``, written over ``gradient``."""
    return torch.ops.aten.threshold_backward.grad_input(gradient, out, 0, grad_input=gradient)
