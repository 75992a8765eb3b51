"""Signed distances on a regular grid, for queries far from a surface whose exact distance is slow."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from surfsup import native
from surfsup.native.dispatch import is_built

CHUNK = 100_000  # grid nodes per query of a mesh
NativeGrid = tuple[np.ndarray, tuple[float, ...], tuple[float, ...], float, tuple[int, ...]]


class SdfGrid(nn.Module):
    """Signed distance and gradient at the nodes of a grid, interpolated between them and extrapolated beyond them.

    Between nodes x_i with distance f_i and gradient g_i the value is Σ w_i (f_i + ½ g_i·(p - x_i)) with trilinear
    weights w_i. Trilinear interpolation of f_i alone errs by the curvature; the weighted mean of the first-order
    expansions errs by as much in the other direction. Half of each cancels it and leaves an error of third order in
    the cell.

    The interpolated gradient is the trilinear mean of the g_i. It is deliberately not normalized: the shorter it is,
    the less the surrounding nodes agree.

    Args:
        distance: (X, Y, Z) signed distance at the nodes, kept as ``node_distance``.
        gradient: (X, Y, Z, 3) gradient at the nodes.
        lower: (3,) position of the first node, in the precision of the queries.
        cell: Distance from node to node.
        center: (3,) origin of the positions in the table, near the middle of the grid, so that the single precision of
            the table suffices anywhere. None for grids around the origin.
    """

    node_distance: Tensor
    lower: Tensor
    upper: Tensor
    center: Tensor | None
    table: Tensor
    last_cell: Tensor
    stride: Tensor
    corner_offsets: Tensor

    def __init__(
        self, distance: Tensor, gradient: Tensor, lower: Tensor, cell: float, center: Tensor | None = None
    ) -> None:
        super().__init__()
        self.cell, self.shape = float(cell), tuple(distance.shape)
        shape = torch.tensor(self.shape)
        self.register_buffer("node_distance", distance)
        self.register_buffer("lower", lower)
        self.register_buffer("upper", lower + self.cell * (shape - 1).to(lower.dtype))
        self.register_buffer("center", center)
        # The mean Σ w_i (f_i + ½ g_i·(p - x_i)) is one interpolation of four channels, base and g, with
        # base_i = f_i - ½ g_i·x_i.
        gradient = gradient.reshape(-1, 3)
        base = distance.reshape(-1) - 0.5 * (gradient * self.offset(self.nodes())).sum(dim=-1)
        self.register_buffer("table", torch.cat([base[:, None], gradient], dim=-1).float())
        self.register_buffer("last_cell", shape - 2)
        self.register_buffer("stride", torch.tensor([self.shape[1] * self.shape[2], self.shape[2], 1]))
        self.register_buffer("corner_offsets", torch.cartesian_prod(*[torch.tensor([0, 1])] * 3) @ self.stride)

    @classmethod
    def from_distances(cls, distance: Tensor, lower: Tensor, cell: float) -> SdfGrid:
        """A grid in single precision from the distances (X, Y, Z) alone; gradients are central differences."""
        distance = distance.float()
        gradient = torch.stack(torch.gradient(distance, spacing=float(cell)), dim=-1)
        return cls(distance, gradient, lower.float(), cell)

    def nodes(self) -> Tensor:
        """The positions of the nodes (X · Y · Z, 3)."""
        return grid_nodes(self.lower, self.cell, self.shape)

    def native_arguments(self) -> NativeGrid:
        """Table, first node, center, cell and shape, as the native code takes them; the table is not copied."""
        center = torch.zeros(3) if self.center is None else self.center
        return self.table.numpy(), tuple(self.lower.tolist()), tuple(center.tolist()), self.cell, self.shape

    def offset(self, points: Tensor) -> Tensor:
        """``points`` (N, 3) relative to the center."""
        return points if self.center is None else points - self.center

    def sample(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Distance (N,) and gradient (N, 3) at ``points`` (N, 3), differentiable in them.

        Beyond the grid it is the distance to the surface point nearest to the nearest border point of the grid. Apart
        from interpolation errors it is never too small, and too large by at most the size of the surface.
        """
        border = points.clamp(self.lower, self.upper)
        position = (border - self.lower) / self.cell
        cell = torch.minimum(position.detach().long(), self.last_cell)
        fraction = (position - cell).float().unsqueeze(-1)
        sides = torch.cat([1 - fraction, fraction], dim=-1)
        weight = sides[:, 0, :, None, None] * sides[:, 1, None, :, None] * sides[:, 2, None, None, :]
        # A sum instead of a product of integer matrices, which torch lacks on GPUs.
        corners = self.table[(cell * self.stride).sum(dim=-1)[:, None] + self.corner_offsets]
        mean = torch.einsum("nk,nkc->nc", weight.reshape(-1, 8), corners).to(points.dtype)
        gradient = mean[:, 1:]
        distance = mean[:, 0] + 0.5 * (self.offset(border) * gradient).sum(dim=-1)
        beyond = (points - border).detach().ne(0).any(dim=-1)
        if points.device.type != "cpu" or bool(beyond.any()):  # the host does not wait for a GPU
            away = points - border + distance[:, None] * nn.functional.normalize(gradient, dim=-1)
            distance = torch.where(beyond, torch.linalg.vector_norm(away, dim=-1), distance)
            gradient = torch.where(beyond[:, None], away, gradient)
        return distance, gradient

    # The methods below are for meshes: double precision on the CPU, without gradients. They use NumPy, since torch's
    # threads cost more than they save on arrays this small.

    def interpolate(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (N,) and mean gradient (N, 3) at ``points`` (N, 3) float64 inside the grid."""
        if is_built():
            points = np.ascontiguousarray(points)
            distance, gradient = np.empty(len(points)), np.empty_like(points)
            native.interpolate_grid(self.native_arguments(), points, distance, gradient, torch.get_num_threads())
            return distance, gradient
        position = (points - self.lower.numpy()) / self.cell
        cell = np.minimum(position.astype(np.int64), self.last_cell.numpy())
        fraction = (position - cell).astype(np.float32)
        x, y, z = np.stack([1 - fraction, fraction], axis=-1).transpose(1, 0, 2)
        weight = (x[:, :, None, None] * y[:, None, :, None] * z[:, None, None, :]).reshape(-1, 1, 8)
        corners = self.table.numpy()[(cell @ self.stride.numpy())[:, None] + self.corner_offsets.numpy()]
        mean = np.matmul(weight, corners)[:, 0].astype(np.float64)
        gradient = mean[:, 1:]
        return mean[:, 0] + 0.5 * (self.offset(torch.from_numpy(points)).numpy() * gradient).sum(axis=1), gradient

    def contains(self, points: np.ndarray) -> np.ndarray:
        """Whether each of ``points`` (N, 3) is inside the grid, (N,)."""
        return np.all((points >= self.lower.numpy()) & (points <= self.upper.numpy()), axis=1)

    def nearest_node(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (N,) from ``points`` (N, 3) inside the grid to the nearest node, and the index (N,) of that node."""
        position = (points - self.lower.numpy()) / self.cell
        node = position.round()
        return np.linalg.norm(position - node, axis=1) * self.cell, node.astype(np.int64) @ self.stride.numpy()


def grid_nodes(lower: Tensor, cell: float, shape: tuple[int, ...]) -> Tensor:
    """The nodes (X · Y · Z, 3) of a grid of ``shape`` that starts at ``lower`` (3,), z varying fastest."""
    axes = [
        low + cell * torch.arange(count, dtype=lower.dtype, device=lower.device)
        for low, count in zip(lower, shape, strict=True)
    ]
    return torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1).reshape(-1, 3)
