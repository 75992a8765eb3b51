"""The paper's multilayer perceptron: two hidden layers with ReLU, then LayerNorm (supplement, section 6)."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torch.autograd.function import once_differentiable

from surfsup.learned.message_passing.linear import Linear, linear, weight_gradient
from surfsup.learned.message_passing.native_layers import Weights, apply_to_rows


class Mlp(nn.Module):
    """Linear, ReLU, linear, ReLU, linear, LayerNorm, in the precision of the input."""

    def __init__(self, inputs: int, width: int) -> None:
        super().__init__()
        self.hidden_1 = nn.Linear(inputs, width)
        self.hidden_2 = nn.Linear(width, width)
        self.output = nn.Linear(width, width)
        self.norm = nn.LayerNorm(width)

    def forward(self, rows: Tensor, precision: torch.dtype | None = None) -> Tensor:
        """(M, inputs) -> (M, width). All but the first layer computes in ``precision``, by default that of the rows."""
        weight, bias = self.hidden_1.weight.to(rows.dtype), self.hidden_1.bias.to(rows.dtype)
        return self.from_first_hidden(Linear.apply(rows, weight, bias).relu().to(precision or rows.dtype))

    def forward_native(
        self, rows: Tensor, first: torch.dtype, precision: torch.dtype, out: torch.dtype = torch.float32
    ) -> Tensor:
        """:meth:`forward` in C++; see :func:`apply_to_rows` for the three precisions."""
        weights = self.native_weights(self.hidden_1.weight, self.hidden_1.bias)
        return apply_to_rows(rows, weights, self.norm.eps, first, precision, out)

    def native_weights(self, first: Tensor, first_bias: Tensor | None) -> Weights:
        """The parameters for C++, with those of the first layer given."""
        return Weights(
            first,
            first_bias,
            self.hidden_2.weight,
            self.hidden_2.bias,
            self.output.weight,
            self.output.bias,
            self.norm.weight,
            self.norm.bias,
        )

    def from_first_hidden(self, hidden: Tensor) -> Tensor:
        """All layers after the first ReLU, from its output (M, width)."""
        parameters = (
            self.hidden_2.weight,
            self.hidden_2.bias,
            self.output.weight,
            self.output.bias,
            self.norm.weight,
            self.norm.bias,
        )
        return FromFirstHidden.apply(hidden, *(parameter.to(hidden.dtype) for parameter in parameters), self.norm.eps)


class FromFirstHidden(torch.autograd.Function):
    """Linear, ReLU, linear, LayerNorm as one operation, which keeps and copies less than torch's own four."""

    @staticmethod
    def forward(
        ctx: Any,
        hidden_1: Tensor,
        hidden_weight: Tensor,
        hidden_bias: Tensor,
        output_weight: Tensor,
        output_bias: Tensor,
        scale: Tensor,
        shift: Tensor,
        eps: float,
    ) -> Tensor:
        """The output of the first hidden layer (M, width) -> (M, width)."""
        hidden_2 = linear(hidden_1, hidden_weight, hidden_bias, relu=True)
        output = linear(hidden_2, output_weight, output_bias)
        normalized, mean, inverse_std = torch.native_layer_norm(output, scale.shape, scale, shift, eps)
        ctx.save_for_backward(hidden_1, hidden_2, output, mean, inverse_std, hidden_weight, output_weight, scale, shift)
        return normalized

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients of the input and of all parameters."""
        hidden_1, hidden_2, output, mean, inverse_std, hidden_weight, output_weight, scale, shift = ctx.saved_tensors
        to_output, to_scale, to_shift = torch.ops.aten.native_layer_norm_backward(
            gradient.contiguous(), output, scale.shape, mean, inverse_std, scale, shift, [True, True, True]
        )
        if gradient.dtype == torch.bfloat16 and gradient.device.type == "cpu":
            # There torch adds up bfloat16 in bfloat16, and the sum over many rows stops growing.
            rows, normalized = gradient.float(), (output.float() - mean) * inverse_std
            to_scale, to_shift = (rows * normalized).sum(dim=0), rows.sum(dim=0)
        to_hidden_2 = relu_backward_(linear(to_output, output_weight.t()), hidden_2)
        to_hidden_1 = linear(to_hidden_2, hidden_weight.t())
        return (
            to_hidden_1,
            weight_gradient(to_hidden_2, hidden_1),
            to_hidden_2.sum(dim=0),
            weight_gradient(to_output, hidden_2),
            to_output.sum(dim=0),
            to_scale,
            to_shift,
            None,
        )


def relu_backward_(gradient: Tensor, output: Tensor) -> Tensor:
    """The gradient through a ReLU with this output, written over ``gradient``."""
    return torch.ops.aten.threshold_backward.grad_input(gradient, output, 0, grad_input=gradient)
