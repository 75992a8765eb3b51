"""Kernel sums over neighbors in torch, with gradients.

An edge carries four kernels: the smoothing kernel, and the three components of its gradient. Density, divergence and
pressure forces are sums of these over the neighbors.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from surfsup import native
from surfsup.errors import SimulationError
from surfsup.native.dispatch import can_run_native
from surfsup.sph.kernels import KERNEL_SUPPORT, cubic_spline, cubic_spline_gradient
from surfsup.sph.neighbor_search import NeighborList, join_neighbor_lists

KERNELS = 4
# Sign of each kernel when an edge is reversed: the smoothing kernel is even, its gradient odd.
PARITY = (1.0, -1.0, -1.0, -1.0)
NATIVE_CHANNELS = 4  # for which the C++ sums are compiled


@dataclass(frozen=True)
class KernelGraph:
    """Neighbor pairs as edges, with the kernels of each.

    Attributes:
        neighbors: N particles, E directed edges.
        kernels: (E, 4) the kernel W / W(0), and the components of -W' / (2 W(0)) towards the sender, W' per support.
    """

    neighbors: NeighborList
    kernels: Tensor

    def __len__(self) -> int:
        """The number of particles."""
        return len(self.neighbors.starts) - 1

    @cached_property
    def gather_matrix(self) -> Tensor:
        """The sparse matrix (N, 4N) that sums the messages of each sender and kernel."""
        neighbors, count = self.neighbors, len(self)
        columns = neighbors.senders[:, None] * KERNELS + torch.arange(KERNELS, device=neighbors.senders.device)
        values = self.kernels.detach().flatten()
        return sparse_matrix(neighbors.starts * KERNELS, columns.flatten(), values, (count, count * KERNELS))

    @cached_property
    def scatter_matrix(self) -> Tensor:
        """The transpose of :attr:`gather_matrix`, (4N, N).

        An edge and its reverse have the same kernels up to parity. So the transpose has rows (particle, kernel) over
        the same neighbors, and needs no sorting.
        """
        neighbors, count = self.neighbors, len(self)
        kernel = torch.arange(KERNELS, device=neighbors.senders.device)
        degree = neighbors.starts.diff()
        rows = neighbors.starts[:-1, None] * KERNELS + degree[:, None] * kernel
        first = neighbors.starts[:-1] * (KERNELS - 1)
        edge = torch.arange(len(neighbors.senders), device=kernel.device)
        place = first.index_select(0, neighbors.receivers) + edge
        places = place[:, None] + degree.index_select(0, neighbors.receivers)[:, None] * kernel
        values = torch.empty(places.numel(), dtype=self.kernels.dtype, device=kernel.device)
        values[places] = self.kernels.detach() * self.kernels.new_tensor(PARITY)
        columns = neighbors.senders.new_empty(places.numel())
        columns[places] = neighbors.senders[:, None].expand_as(places)
        starts = torch.cat([rows.flatten(), neighbors.starts[-1:] * KERNELS])
        return sparse_matrix(starts, columns, values, (count * KERNELS, count))


def sparse_matrix(starts: Tensor, columns: Tensor, values: Tensor, size: tuple[int, int]) -> Tensor:
    """A compressed sparse row matrix with the 32-bit indices of torch's fast product.

    Raises:
        SimulationError: there are more elements than 32 bits count.
    """
    if columns.numel() >= 2**31:
        raise SimulationError(
            f"there are {columns.numel() // KERNELS} neighbor pairs, and torch's sparse matrices hold "
            f"{2**31 // KERNELS}; simulate fewer particles, or on a CPU with the native code"
        )
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Sparse CSR tensor support is in beta")
        return torch.sparse_csr_tensor(starts.int(), columns.int(), values, size=size, check_invariants=False)


def kernel_graph(positions: Tensor, neighbors: NeighborList) -> KernelGraph:
    """The kernels between ``positions`` (N, 3) in meters of neighbors, differentiable in the positions."""
    displacement = (
        positions.index_select(0, neighbors.senders) - positions.index_select(0, neighbors.receivers)
    ) / KERNEL_SUPPORT
    q = torch.linalg.vector_norm(displacement, dim=-1, keepdim=True)
    gradient = -0.5 * cubic_spline_gradient(q) * displacement / q.clamp(min=1e-6)
    return KernelGraph(neighbors, torch.cat([cubic_spline(q), gradient], dim=-1))


def join_graphs(graphs: list[KernelGraph]) -> KernelGraph:
    """Several graphs as one, without edges between them."""
    if len(graphs) == 1:
        return graphs[0]
    neighbors = join_neighbor_lists([graph.neighbors for graph in graphs])
    return KernelGraph(neighbors, torch.cat([graph.kernels for graph in graphs]))


def kernel_sums(values: Tensor, graph: KernelGraph) -> Tensor:
    """The sum over neighbors for every kernel: sum_j k_m(i, j) v_j, (N, C) -> (N, 4, C)."""
    if values.shape[1] == NATIVE_CHANNELS and can_sum_native(graph, values):
        return NativeKernelSums.apply(values, graph)
    return KernelSums.apply(values, graph.kernels, graph)


def can_sum_native(graph: KernelGraph, values: Tensor) -> bool:
    """Whether C++ can compute the sums: it has gradients in the values, but not in the kernels."""
    return can_run_native(values.detach(), graph.kernels)


class KernelSums(torch.autograd.Function):
    """:func:`kernel_sums` as products with sparse matrices, and both of its gradients."""

    @staticmethod
    def forward(context: Any, values: Tensor, kernels: Tensor, graph: KernelGraph) -> Tensor:
        """(N, C) values of the senders -> (N, 4, C). ``kernels`` are the graph's, an argument for their gradient."""
        context.save_for_backward(values)
        context.graph, context.signs = graph, parity_of(values)
        return (graph.scatter_matrix @ values).unflatten(0, (len(graph), KERNELS)) * context.signs

    @staticmethod
    def backward(context: Any, gradient: Tensor) -> tuple[Tensor | None, Tensor | None, None]:
        """Gradients in the values and in the kernels."""
        graph, neighbors = context.graph, context.graph.neighbors
        in_values = in_kernels = None
        if context.needs_input_grad[0]:
            in_values = graph.gather_matrix @ (gradient * context.signs).flatten(0, 1)
        if context.needs_input_grad[1]:
            (values,) = context.saved_tensors
            sent = values.index_select(0, neighbors.senders)
            received = gradient.index_select(0, neighbors.receivers)
            in_kernels = torch.bmm(received, sent[:, :, None]).squeeze(-1)
        return in_values, in_kernels, None


class NativeKernelSums(torch.autograd.Function):
    """:func:`kernel_sums` of four channels in C++."""

    @staticmethod
    def forward(context: Any, values: Tensor, graph: KernelGraph) -> Tensor:
        """(N, 4) values of the senders -> (N, 4, 4)."""
        context.graph = graph
        sums = values.new_empty(len(graph), KERNELS, NATIVE_CHANNELS)
        native.sum_kernels(*graph_arrays(graph), as_array(values), as_array(sums), torch.get_num_threads())
        return sums

    @staticmethod
    @once_differentiable
    def backward(context: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        """The gradient in the values."""
        (gradient,) = gradients
        in_values = gradient.new_empty(len(gradient), NATIVE_CHANNELS)
        arrays = as_array(gradient), as_array(in_values)
        native.sum_kernels_gradient(*graph_arrays(context.graph), *arrays, torch.get_num_threads())
        return in_values, None


def parity_of(like: Tensor) -> Tensor:
    """The parities (4, 1) with the type and device of a tensor."""
    return like.new_tensor(PARITY)[:, None]


def graph_arrays(graph: KernelGraph) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Starts, senders and kernels for C++ functions."""
    return as_array(graph.neighbors.starts), as_array(graph.neighbors.senders), as_array(graph.kernels)


def as_array(tensor: Tensor) -> np.ndarray:
    """A contiguous NumPy array that shares the tensor's memory where the tensor is contiguous."""
    return tensor.detach().contiguous().numpy()
