"""SOAP: Adam in the directions in which the gradients of a matrix vary on their own.

N. Vyas et al., "SOAP: Improving and Stabilizing Shampoo using Adam" (2024). Per step it brings this model's error down
faster than Adam does (``docs/experiments.md``); for matrices this small its own work is a hundredth of a step's.
"""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor

TINY = 1e-30  # what has no gradient at all stays where it is


class Soap(torch.optim.Optimizer):
    """Adam in the eigenbases of the averaged products of each matrix's gradient with itself.

    All of its state is tensors, so that a run can be saved without pickling and goes on bit by bit. What is no matrix
    is left to Adam.

    Args:
        parameters: what is trained.
        lr: learning rate, to be compared with Adam's.
        betas: how much of the averages of the gradient, and of its square and products, is kept in a step.
        every: steps from one turn of the bases to the next.
        eps: share of the largest root mean square of a parameter's gradient that is added to all: what is smaller is
            rounding.
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
    def step(self, closure: None = None) -> None:
        """One step by the gradients that are there; the first only lays the bases."""
        for group in self.param_groups:
            for parameter in group["params"]:
                if parameter.grad is None:
                    continue
                state = self.state[parameter]
                if not state:
                    # As its authors do: seen in bases of its own, it has no size but in a few directions.
                    state |= beginning(parameter.grad)
                    continue
                change(parameter, state, group["lr"], *group["betas"], group["eps"])
                if parameter.ndim == 2 and int(state["step"]) % group["every"] == 0:
                    turn(state)


def beginning(gradient: Tensor) -> dict[str, Tensor]:
    """The state before a parameter's first step, from a gradient that moves nothing yet.

    All of it is contiguous, as it is when read from a file: products of what is not are rounded otherwise.
    """
    state = {
        "step": torch.zeros(()),
        "mean": torch.zeros_like(gradient),
        "mean_square": torch.zeros_like(gradient),
    }
    if gradient.ndim == 2:
        products = {"rows": gradient @ gradient.T, "columns": gradient.T @ gradient}
        bases = {
            f"{name}_basis": torch.linalg.eigh(product).eigenvectors.contiguous() for name, product in products.items()
        }
        state |= products | bases
    return state


def change(parameter: Tensor, state: dict[str, Tensor], rate: float, first: float, second: float, eps: float) -> None:
    """Move a parameter, and bring its averages up to date."""
    gradient = parameter.grad
    state["step"] += 1
    step = int(state["step"])
    state["mean"].lerp_(gradient, 1 - first)
    mean, seen = state["mean"], gradient
    if parameter.ndim == 2:
        rows, columns = state["rows_basis"], state["columns_basis"]
        mean, seen = rows.T @ mean @ columns, rows.T @ gradient @ columns
        state["rows"].lerp_(gradient @ gradient.T, 1 - second)
        state["columns"].lerp_(gradient.T @ gradient, 1 - second)
    state["mean_square"].lerp_(seen.square(), 1 - second)
    size = (state["mean_square"] / (1 - second**step)).sqrt()
    move = mean / (1 - first**step) / (size + eps * size.max() + TINY)
    parameter.sub_(rows @ move @ columns.T if parameter.ndim == 2 else move, alpha=rate)


def turn(state: dict[str, Tensor]) -> None:
    """Bring the bases nearer to the eigenvectors of the products: one power iteration, made orthogonal again.

    The mean square goes along, as if what is along different old directions were independent. Left as it was, it would
    be far too small for a direction that had been still until now, and the next steps would be as much too long.
    """
    shares = {}
    for name in ("rows", "columns"):
        before = state[f"{name}_basis"]
        state[f"{name}_basis"] = torch.linalg.qr(state[name] @ before).Q.contiguous()
        shares[name] = (state[f"{name}_basis"].T @ before).square()
    state["mean_square"] = shares["rows"] @ state["mean_square"] @ shares["columns"].T
