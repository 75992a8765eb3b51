"""Neighbor search: all ordered pairs of particles within a radius."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from surfsup import native
from surfsup.native.dispatch import can_run_native
from surfsup.sph.cell_list import pairs_by_cells
from surfsup.sph.stability import check_pairs, max_pairs, not_finite


@dataclass(frozen=True)
class NeighborList:
    """Directed edges, grouped by receiver.

    Attributes:
        starts: (N + 1,) int64; the edges of receiver i are starts[i] to starts[i + 1].
        receivers: (E,) int64, ascending.
        senders: (E,) int64. No particle is its own neighbor; with (i, j) there is always (j, i).
    """

    starts: Tensor
    receivers: Tensor
    senders: Tensor


def find_neighbors(positions: Tensor, radius: float) -> NeighborList:
    """All pairs of ``positions`` (N, 3) within ``radius`` meters, in both directions, on the positions' device.

    Raises:
        SimulationError: a position is not finite, or the particles have collapsed into a clump.
    """
    if can_run_native(positions.detach()):
        return neighbors_native(positions, radius)
    search = pairs_by_tree if positions.device.type == "cpu" else pairs_by_cells
    receivers, senders = search(positions, radius)
    check_pairs(len(receivers), len(positions), radius)
    numbers = torch.arange(len(positions) + 1, device=positions.device)
    return NeighborList(torch.searchsorted(receivers, numbers), receivers, senders)


def neighbors_native(positions: Tensor, radius: float) -> NeighborList:
    """:func:`find_neighbors` by a cell list in C++."""
    limit = max_pairs(len(positions), radius)
    points = positions.detach().contiguous().numpy()
    pairs, *found = native.find_neighbor_pairs(points, radius, limit, torch.get_num_threads())
    check_pairs(pairs, len(positions), radius)
    return NeighborList(*(torch.from_numpy(values) for values in found))


def pairs_by_tree(positions: Tensor, radius: float) -> tuple[Tensor, Tensor]:
    """Receivers (E,) and senders (E,), ordered by receiver, then by sender.

    Uses scipy's k-d tree. An unbalanced tree is the fastest to build (measured).

    Raises:
        SimulationError: a position is not finite.
    """
    from scipy.spatial import cKDTree

    points = positions.detach().numpy()
    if not np.isfinite(points).all():
        raise not_finite()
    tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
    pairs = tree.query_pairs(radius, output_type="ndarray")
    receivers = np.concatenate([pairs[:, 0], pairs[:, 1]])
    senders = np.concatenate([pairs[:, 1], pairs[:, 0]])
    order = np.argsort(receivers * len(points) + senders)
    return torch.from_numpy(receivers[order]), torch.from_numpy(senders[order])


def join_neighbor_lists(parts: list[NeighborList]) -> NeighborList:
    """Several lists as one, without edges between them."""
    starts, receivers, senders, particles, edges = [], [], [], 0, 0
    for part in parts:
        starts.append(part.starts[:-1] + edges)
        receivers.append(part.receivers + particles)
        senders.append(part.senders + particles)
        particles, edges = particles + len(part.starts) - 1, edges + len(part.senders)
    starts.append(parts[0].starts.new_tensor([edges]))
    return NeighborList(torch.cat(starts), torch.cat(receivers), torch.cat(senders))
