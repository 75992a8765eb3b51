"""Which particles see which: all ordered pairs within the connectivity radius."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import Tensor

from surfsup import native
from surfsup.sph.cell_list import pairs_by_cells
from surfsup.sph.stability import blown_up, collapsed, max_edges


@dataclass(frozen=True)
class NeighborList:
    """Directed edges grouped by receiver.

    Attributes:
        starts: (N + 1,) int64; the edges of receiver i are starts[i] up to starts[i + 1].
        receivers: (E,) int64, ascending.
        senders: (E,) int64. A particle is never its own sender; with (i, j) there is always (j, i).
    """

    starts: Tensor
    receivers: Tensor
    senders: Tensor


def find_neighbors(positions: Tensor, radius: float) -> NeighborList:
    """All pairs of ``positions`` (N, 3) nearer than ``radius``, in both directions.

    The search runs where the positions are; the result lies there too.

    Raises:
        SimulationError: a position is not finite, or the particles have collapsed into a clump, in which everybody
            sees everybody.
    """
    if positions.device.type == "cpu" and positions.dtype == torch.float32 and native.instruction_sets():
        return find_neighbors_native(positions, radius)
    find_pairs = pairs_by_tree if positions.device.type == "cpu" else pairs_by_cells
    receivers, senders = find_pairs(positions, radius)
    if len(receivers) > max_edges(len(positions), radius):
        raise collapsed(radius)
    count = torch.arange(len(positions) + 1, device=positions.device)
    return NeighborList(torch.searchsorted(receivers, count), receivers, senders)


def find_neighbors_native(positions: Tensor, radius: float) -> NeighborList:
    """The same by a cell list in C++.

    Raises:
        SimulationError: as in :func:`neighborhood`.
    """
    most = max_edges(len(positions), radius)
    points = positions.detach().contiguous().numpy()
    edges, *found = native.find_pairs(points, radius, most, torch.get_num_threads())
    if edges < 0:
        raise blown_up()
    if edges > most:
        raise collapsed(radius)
    return NeighborList(*(torch.from_numpy(values) for values in found))


def pairs_by_tree(positions: Tensor, radius: float) -> tuple[Tensor, Tensor]:
    """Receivers (E,) and senders (E,), ordered by receiver, then by sender.

    By scipy's k-d tree, unbalanced, which is the fastest to build on a CPU (measured).

    Raises:
        SimulationError: a position is not finite.
    """
    points = positions.detach().numpy()
    if not np.isfinite(points).all():
        raise blown_up()
    tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
    pairs = tree.query_pairs(radius, output_type="ndarray")
    receivers = np.concatenate([pairs[:, 0], pairs[:, 1]])
    senders = np.concatenate([pairs[:, 1], pairs[:, 0]])
    order = np.argsort(receivers * len(points) + senders)
    return torch.from_numpy(receivers[order]), torch.from_numpy(senders[order])


def join_neighbor_lists(parts: list[NeighborList]) -> NeighborList:
    """Several neighborhoods side by side as one, with no edge between them."""
    starts, receivers, senders, particles, edges = [], [], [], 0, 0
    for part in parts:
        starts.append(part.starts[:-1] + edges)
        receivers.append(part.receivers + particles)
        senders.append(part.senders + particles)
        particles, edges = particles + len(part.starts) - 1, edges + len(part.senders)
    starts.append(parts[0].starts.new_tensor([edges]))
    return NeighborList(torch.cat(starts), torch.cat(receivers), torch.cat(senders))
