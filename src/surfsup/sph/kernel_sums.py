"""A continuous convolution over particles with fixed kernels, as one sparse matrix product.

An edge carries four fixed kernels, those that the solver itself sums density and pressure with: its smoothing kernel,
and the kernel's slope times the three components of the direction. A layer is a learned mixture of the four, so its
cost is that of one sparse product:

    out_i = sum_j sum_m k_m(x_j - x_i) (W_m h_j)
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor, nn

from surfsup.errors import SimulationError
from surfsup.learned.corrected.native_convolution import (
    FOUR,
    NativeConvolution,
    NativeKernelSums,
    can_convolve,
    can_sum,
)
from surfsup.sph.neighbor_search import NeighborList, join_neighbor_lists

KERNELS = 4
# The smoothing kernel is even in the displacement, its slope times a direction is odd.
PARITY = (1.0, -1.0, -1.0, -1.0)


@dataclass(frozen=True)
class Graph:
    """Edges and their kernels: all that the network sees of the particles' places.

    Attributes:
        neighborhood: N particles, E directed edges.
        kernels: (E, 4).
    """

    neighborhood: NeighborList
    kernels: Tensor

    def __len__(self) -> int:
        """The number of particles."""
        return len(self.neighborhood.starts) - 1

    @cached_property
    def gathering(self) -> Tensor:
        """The sparse matrix (N, 4N) from the messages of each particle and kernel to their sums."""
        near, count = self.neighborhood, len(self)
        columns = near.senders[:, None] * KERNELS + torch.arange(KERNELS, device=near.senders.device)
        values = self.kernels.detach().flatten()
        return sparse(near.starts * KERNELS, columns.flatten(), values, (count, count * KERNELS))

    @cached_property
    def spreading(self) -> Tensor:
        """The transpose of :attr:`gathering`, (4N, N).

        An edge and its reverse have the same kernels up to the sign of the odd ones, so the transpose has the
        rows (particle, kernel) over the same neighbors, and needs no sorting.
        """
        near, count = self.neighborhood, len(self)
        kernel = torch.arange(KERNELS, device=near.senders.device)
        degree = near.starts.diff()
        rows = near.starts[:-1, None] * KERNELS + degree[:, None] * kernel
        first = near.starts[:-1] * (KERNELS - 1)
        place = first.index_select(0, near.receivers) + torch.arange(len(near.senders), device=kernel.device)
        places = place[:, None] + degree.index_select(0, near.receivers)[:, None] * kernel
        values = torch.empty(places.numel(), dtype=self.kernels.dtype, device=kernel.device)
        values[places] = self.kernels.detach() * self.kernels.new_tensor(PARITY)
        columns = near.senders.new_empty(places.numel())
        columns[places] = near.senders[:, None].expand_as(places)
        starts = torch.cat([rows.flatten(), near.starts[-1:] * KERNELS])
        return sparse(starts, columns, values, (count * KERNELS, count))


def sparse(starts: Tensor, columns: Tensor, values: Tensor, size: tuple[int, int]) -> Tensor:
    """A compressed sparse row matrix; 32-bit indices are what the fast product takes.

    Raises:
        SimulationError: it has more elements than these can count.
    """
    if columns.numel() >= 2**31:
        raise SimulationError(
            f"the particles have {columns.numel() // KERNELS} pairs of neighbors, and torch's sparse matrices hold "
            f"{2**31 // KERNELS}; simulate fewer particles, or on a CPU with the native step"
        )
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Sparse CSR tensor support is in beta")
        return torch.sparse_csr_tensor(starts.int(), columns.int(), values, size=size, check_invariants=False)


def graph(positions: Tensor, neighbors: NeighborList, radius: float) -> Graph:
    """The graph of ``positions`` (N, 3), its kernels differentiable in them; nothing reaches past ``radius``.

    The smoothing kernel is the cubic spline W (J. J. Monaghan, "Smoothed particle hydrodynamics", Annual Review of
    Astronomy and Astrophysics 30, 1992), as a share of W(0); the slope is -W'/2 in that share a radius, at most 1. The
    direction is that to the neighbor, in which density rises.
    """
    displacement = (
        positions.index_select(0, neighbors.senders) - positions.index_select(0, neighbors.receivers)
    ) / radius
    distance = torch.linalg.vector_norm(displacement, dim=-1, keepdim=True)
    whole, inner = (1 - distance).clamp(min=0), (0.5 - distance).clamp(min=0)
    window = 2 * whole**3 - 8 * inner**3
    slope = 3 * whole**2 - 12 * inner**2
    return Graph(neighbors, torch.cat([window, slope * displacement / distance.clamp(min=1e-6)], dim=-1))


def join(graphs: list[Graph]) -> Graph:
    """Several graphs side by side as one, with no edge between them."""
    if len(graphs) == 1:
        return graphs[0]
    merged = join_neighbor_lists([part.neighborhood for part in graphs])
    return Graph(merged, torch.cat([part.kernels for part in graphs]))


def convolve(hidden: Tensor, mix: Tensor, own: Tensor, graph: Graph) -> Tensor:
    """Messages of all neighbors and the particle's own: (N, C) -> (N, C).

    Args:
        hidden: (N, C), of which neighbors are told the first M.
        mix: (4C, M), the learned matrix of each kernel.
        own: (C, C).
        graph: the neighbors.
    """
    if can_convolve(graph, hidden, mix):
        return NativeConvolution.apply(hidden, mix, own, graph)
    count, width = hidden.shape
    mixed = nn.functional.linear(hidden[:, : mix.shape[1]], mix).reshape(count, KERNELS, width)
    return Gather.apply(mixed, graph.kernels, graph) + nn.functional.linear(hidden, own)


def kernel_sums(values: Tensor, graph: Graph) -> Tensor:
    """The sum over neighbors for every kernel apart, not mixed: (N, C) -> (N, 4, C)."""
    if values.shape[1] == FOUR and can_sum(graph, values):
        return NativeKernelSums.apply(values, graph)
    return KernelSums.apply(values, graph.kernels, graph)


class Gather(torch.autograd.Function):
    """The sum over neighbors and kernels, with both of its gradients written as sparse products."""

    @staticmethod
    def forward(context: torch.autograd.function.FunctionCtx, mixed: Tensor, kernels: Tensor, graph: Graph) -> Tensor:
        """(N, 4, C) messages of each sender and kernel -> (N, C) sums of each receiver.

        ``kernels`` are those of ``graph``, named apart so that their gradient is asked for.
        """
        context.save_for_backward(mixed if context.needs_input_grad[1] else mixed.new_empty(0))
        context.graph = graph
        return graph.gathering @ mixed.flatten(0, 1)

    @staticmethod
    def backward(
        context: torch.autograd.function.FunctionCtx, gradient: Tensor
    ) -> tuple[Tensor | None, Tensor | None, None]:
        """Gradients in the messages and, where asked for, in the kernels."""
        graph = context.graph
        to_mixed = to_kernels = None
        if context.needs_input_grad[0]:
            to_mixed = (graph.spreading @ gradient.contiguous()).unflatten(0, (len(graph), KERNELS))
        if context.needs_input_grad[1]:
            (mixed,) = context.saved_tensors
            # Each kernel's is the product of what was sent along its edge and what came back, at no other pairs: copies
            # of both for every edge would be an order of magnitude slower (measured).
            products = torch.sparse.sampled_addmm(
                graph.gathering, gradient.contiguous(), mixed.flatten(0, 1).T, beta=0.0
            )
            to_kernels = products.values().unflatten(0, (-1, KERNELS))
        return to_mixed, to_kernels, None


class KernelSums(torch.autograd.Function):
    """The sum over neighbors for every kernel apart, not mixed: density, divergence and the like are made of these."""

    @staticmethod
    def forward(context: torch.autograd.function.FunctionCtx, values: Tensor, kernels: Tensor, graph: Graph) -> Tensor:
        """(N, C) values of the senders -> (N, 4, C) sums of the receivers; ``kernels`` are those of ``graph``."""
        context.save_for_backward(values)
        context.graph, context.signs = graph, parity(values)
        return (graph.spreading @ values).unflatten(0, (len(graph), KERNELS)) * context.signs

    @staticmethod
    def backward(
        context: torch.autograd.function.FunctionCtx, gradient: Tensor
    ) -> tuple[Tensor | None, Tensor | None, None]:
        """Gradients in the values and, where asked for, in the kernels."""
        graph, near = context.graph, context.graph.neighborhood
        to_values = to_kernels = None
        if context.needs_input_grad[0]:
            to_values = graph.gathering @ (gradient * context.signs).flatten(0, 1)
        if context.needs_input_grad[1]:
            (values,) = context.saved_tensors
            sent = values.index_select(0, near.senders)
            received = gradient.index_select(0, near.receivers)
            to_kernels = torch.bmm(received, sent[:, :, None]).squeeze(-1)
        return to_values, to_kernels, None


def parity(like: Tensor) -> Tensor:
    """The sign (4, 1) that each kernel takes when an edge is turned around."""
    return like.new_tensor(PARITY)[:, None]
