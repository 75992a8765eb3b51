"""SOAP: Adam in the eigenbasis of Shampoo's preconditioner.

N. Vyas et al., "SOAP: Improving and Stabilizing Shampoo using Adam" (2024). Per step it lowers the loss of our models
faster than Adam (``docs/log-first-days.md``). For matrices as small as theirs it costs a hundredth of a training step.
"""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor

TINY = 1e-30  # keeps the update of a parameter whose gradients are all zero at zero


class Soap(torch.optim.Optimizer):
    """Adam in the eigenbases of the averaged products G Gᵀ and Gᵀ G of each matrix's gradient G.

    Parameters that are not matrices get plain Adam updates. The state consists of tensors alone, so that a run can be
    saved without pickling and resumed bit for bit.

    Args:
        parameters: the parameters to optimize.
        lr: learning rate, comparable to Adam's.
        betas: decay of the averaged gradient, and of its averaged square and products.
        every: steps between two updates of the eigenbases.
        eps: share of a parameter's largest root mean square gradient that is added to every denominator; smaller
            gradients are rounding errors.
    """

    def __init__(
        self,
        parameters: Iterable[Tensor],
        lr: float,
        betas: tuple[float, float] = (0.95, 0.98),
        every: int = 10,
        eps: float = 1e-6,
    ) -> None:
        super().__init__(parameters, {"lr": lr, "betas": betas, "every": every, "eps": eps})

    @torch.no_grad()
    def step(self, closure: None = None) -> None:  # type: ignore[override]  # no closure is ever evaluated
        """Take one step; the first only initializes the eigenbases."""
        for group in self.param_groups:
            for parameter in group["params"]:
                if parameter.grad is None:
                    continue
                state = self.state[parameter]
                if not state:
                    # As in the authors' code: in its own eigenbasis a single gradient is zero in most directions, and
                    # Adam would divide by those.
                    state |= initial_state(parameter.grad)
                    continue
                update(parameter, parameter.grad, state, group["lr"], group["betas"], group["eps"])
                if parameter.ndim == 2 and int(state["step"]) % group["every"] == 0:
                    update_bases(state)


def initial_state(gradient: Tensor) -> dict[str, Tensor]:
    """The state of a parameter before its first update.

    All tensors are contiguous, as they are when read from a file: products of non-contiguous ones round differently.
    """
    state = {
        "step": torch.zeros(()),
        "mean": torch.zeros_like(gradient),
        "mean_square": torch.zeros_like(gradient),
    }
    if gradient.ndim == 2:
        products = {"rows": gradient @ gradient.T, "columns": gradient.T @ gradient}
        bases = {f"{name}_basis": eigenvectors(product) for name, product in products.items()}
        state |= products | bases
    return state


def eigenvectors(product: Tensor) -> Tensor:
    """The eigenvectors of a symmetric matrix as columns, computed in double precision where single gives NaN.

    It gave NaN for the product of a gradient of low rank (64 x 64 of rank 3, the last layer of a decoder).
    """
    vectors = torch.linalg.eigh(product).eigenvectors
    if not bool(vectors.isfinite().all()):
        vectors = torch.linalg.eigh(product.double()).eigenvectors.to(product.dtype)
    return vectors.contiguous()


def update(
    parameter: Tensor, gradient: Tensor, state: dict[str, Tensor], lr: float, betas: tuple[float, float], eps: float
) -> None:
    """Update a parameter and its running averages."""
    beta1, beta2 = betas
    state["step"] += 1
    step = int(state["step"])
    state["mean"].lerp_(gradient, 1 - beta1)
    mean, projected = state["mean"], gradient
    if parameter.ndim == 2:
        rows, columns = state["rows_basis"], state["columns_basis"]
        mean, projected = rows.T @ mean @ columns, rows.T @ gradient @ columns
        state["rows"].lerp_(gradient @ gradient.T, 1 - beta2)
        state["columns"].lerp_(gradient.T @ gradient, 1 - beta2)
    state["mean_square"].lerp_(projected.square(), 1 - beta2)
    rms = (state["mean_square"] / (1 - beta2**step)).sqrt()
    direction = mean / (1 - beta1**step) / (rms + eps * rms.max() + TINY)
    parameter.sub_(rows @ direction @ columns.T if parameter.ndim == 2 else direction, alpha=lr)


def update_bases(state: dict[str, Tensor]) -> None:
    """Bring the bases nearer to the eigenvectors of the products: one power iteration, then orthogonalization.

    The mean square is rotated along, as if the components in the old basis were independent. An unrotated mean square
    would be far too small in a direction without gradients so far, and the next updates too large.
    """
    overlap = {}
    for name in ("rows", "columns"):
        old = state[f"{name}_basis"]
        state[f"{name}_basis"] = torch.linalg.qr(state[name] @ old).Q.contiguous()
        overlap[name] = (state[f"{name}_basis"].T @ old).square()
    state["mean_square"] = overlap["rows"] @ state["mean_square"] @ overlap["columns"].T
