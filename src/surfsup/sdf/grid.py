"""Distances at the nodes of a regular grid, for all who are far from a surface."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from surfsup.sdf.mesh.query import MeshQuery

CHUNK = 100_000  # nodes that the mesh is asked for at once


class Lattice(nn.Module):
    """Signed distances at the nodes of a grid, interpolated between them and continued beyond its border.

    Between nodes x_i with value f_i and gradient g_i (central differences) the value is Σ w_i (f_i + ½ g_i·(p - x_i)),
    w_i the trilinear weights, of third order in the cell. It is differentiable in the points.

    Args:
        values: (X, Y, Z) float, in the surface's own unit.
        lower: (3,) the first node.
        cell: from node to node.
    """

    def __init__(self, values: Tensor, lower: Tensor, cell: float) -> None:
        super().__init__()
        self.cell, self.shape = float(cell), tuple(values.shape)
        self.register_buffer("lower", lower.float())
        self.register_buffer("upper", self.lower + self.cell * (torch.tensor(self.shape) - 1))
        values = values.float()
        gradient = torch.stack(torch.gradient(values, spacing=self.cell), dim=-1)
        gradient = gradient.reshape(-1, 3)
        base = values.reshape(-1) - 0.5 * (gradient * self.nodes()).sum(dim=-1)
        self.register_buffer("table", torch.cat([base[:, None], gradient], dim=-1))
        self.register_buffer("last_cell", torch.tensor(self.shape) - 2)
        self.register_buffer("stride", torch.tensor([self.shape[1] * self.shape[2], self.shape[2], 1]))
        corners = torch.cartesian_prod(*[torch.tensor([0, 1])] * 3)
        self.register_buffer("steps", corners @ self.stride)

    @classmethod
    def around(cls, vertices: np.ndarray, faces: np.ndarray, cell: float, margin: float) -> Lattice:
        """The exact distances to a mesh, at nodes up to ``margin`` beyond its box."""
        values, lower = distances_around(vertices, faces, cell, margin)
        return cls(values, lower, cell)

    def values(self) -> Tensor:
        """The distances at the nodes (X, Y, Z)."""
        return (self.table[:, 0] + 0.5 * (self.table[:, 1:] * self.nodes()).sum(dim=-1)).reshape(self.shape)

    def nodes(self) -> Tensor:
        """Where they are (X · Y · Z, 3)."""
        corners = zip(self.lower, self.shape, strict=True)
        axes = [low + self.cell * torch.arange(count, device=low.device) for low, count in corners]
        return torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1).reshape(-1, 3)

    def grid(self) -> tuple[np.ndarray, tuple[float, ...], float, tuple[int, ...]]:
        """Table, first node, cell and nodes along each axis, as :meth:`surfsup.native.Solid.of_network` takes them."""
        return self.table.numpy(), tuple(self.lower.tolist()), self.cell, self.shape

    def sample(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Distance (N,) and gradient (N, 3) of ``points`` (N, 3).

        Beyond the grid it is the distance to the surface point nearest to the nearest border point: never too small
        but for the grid's own error, too large by at most the size of the surface.
        """
        border = points.clamp(self.lower, self.upper)
        place = (border - self.lower) / self.cell
        cell = torch.minimum(place.detach().long(), self.last_cell)
        along = (place - cell).unsqueeze(-1)
        sides = torch.cat([1 - along, along], dim=-1)
        weight = sides[:, 0, :, None, None] * sides[:, 1, None, :, None] * sides[:, 2, None, None, :]
        # By a sum: on a GPU torch has no product of whole numbers' matrices.
        corners = self.table[(cell * self.stride).sum(dim=-1)[:, None] + self.steps]
        mean = torch.einsum("nk,nkc->nc", weight.reshape(-1, 8), corners)
        gradient = mean[:, 1:]
        distance = mean[:, 0] + 0.5 * (border * gradient).sum(dim=-1)
        beyond = (points - border).detach().ne(0).any(dim=-1)
        if bool(beyond.any()):
            away = points - border + distance[:, None] * nn.functional.normalize(gradient, dim=-1)
            distance = torch.where(beyond, torch.linalg.vector_norm(away, dim=-1), distance)
            gradient = torch.where(beyond[:, None], away, gradient)
        return distance, gradient


def distances_around(vertices: np.ndarray, faces: np.ndarray, cell: float, margin: float) -> tuple[Tensor, Tensor]:
    """Exact signed distances (X, Y, Z) to a mesh at the nodes of a grid around it, and the first node (3,)."""
    query = MeshQuery(vertices, faces)
    lower = vertices.min(axis=0) - margin
    shape = np.ceil((np.ptp(vertices, axis=0) + 2 * margin) / cell).astype(int) + 1
    axes = [low + cell * np.arange(count) for low, count in zip(lower, shape, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    signed = []
    for part in np.array_split(nodes, max(1, len(nodes) // CHUNK)):
        distance, _, _ = query.nearest(part)
        signed.append(np.where(query.inside(part), -distance, distance))
    values = torch.from_numpy(np.concatenate(signed).reshape(shape)).float()
    return values, torch.from_numpy(lower).float()
