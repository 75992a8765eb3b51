"""Which particles see which: all ordered pairs within the connectivity radius."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import Tensor

from surfsup.errors import SimulationError


@dataclass(frozen=True)
class Neighbourhood:
    """Directed edges grouped by receiver.

    Attributes:
        starts: (N + 1,) int64; the edges of receiver i are starts[i] up to starts[i + 1].
        receivers: (E,) int64, ascending.
        senders: (E,) int64. A particle is never its own sender; with (i, j) there is always (j, i).
    """

    starts: Tensor
    receivers: Tensor
    senders: Tensor


def neighbourhood(positions: Tensor, radius: float) -> Neighbourhood:
    """All pairs of ``positions`` (N, 3) nearer than ``radius``, in both directions.

    The search runs on the CPU (scipy's k-d tree, unbalanced, which is the fastest to build: measured), the
    result lies on the device of ``positions``.

    Raises:
        SimulationError: a position is not finite.
    """
    count = len(positions)
    points = positions.detach().cpu().numpy()
    if not np.isfinite(points).all():
        raise SimulationError("the simulation blew up: a particle's position is not a finite number")
    tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
    pairs = tree.query_pairs(radius, output_type="ndarray")
    receivers = np.concatenate([pairs[:, 0], pairs[:, 1]])
    senders = np.concatenate([pairs[:, 1], pairs[:, 0]])
    order = np.argsort(receivers * count + senders)
    receivers, senders = receivers[order], senders[order]
    starts = np.searchsorted(receivers, np.arange(count + 1))
    device = positions.device
    return Neighbourhood(*(torch.from_numpy(part).to(device) for part in (starts, receivers, senders)))


def join_neighbourhoods(parts: list[Neighbourhood]) -> Neighbourhood:
    """Several neighbourhoods side by side as one, with no edge between them."""
    starts, receivers, senders, particles, edges = [], [], [], 0, 0
    for part in parts:
        starts.append(part.starts[:-1] + edges)
        receivers.append(part.receivers + particles)
        senders.append(part.senders + particles)
        particles, edges = particles + len(part.starts) - 1, edges + len(part.senders)
    starts.append(parts[0].starts.new_tensor([edges]))
    return Neighbourhood(torch.cat(starts), torch.cat(receivers), torch.cat(senders))
