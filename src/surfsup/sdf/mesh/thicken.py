"""Sheets without thickness made into walls."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from surfsup.errors import InputError
from surfsup.sdf.marching_cubes import polygonize
from surfsup.sdf.mesh.query import MeshQuery
from surfsup.sdf.mesh.topology import open_edges, parts_of
from surfsup.sdf.surface import Surface

if TYPE_CHECKING:
    import trimesh

CELLS_PER_WALL = 3  # cells of marching cubes across a wall
MAX_CELLS = 256  # along the longest side


def thicken_sheets(mesh: trimesh.Trimesh, thickness: float, source: str) -> trimesh.Trimesh:
    """A mesh whose open parts have become walls; closed parts stay as they are.

    A wall is all points nearer than half the thickness to the part, so that the part is in its middle.

    Args:
        mesh: in meters.
        thickness: of the walls, meters.
        source: name of the mesh for messages.

    Raises:
        InputError: the walls are too thin for a grid over the mesh, or no part is open.
    """
    import trimesh

    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    part = parts_of(faces, len(vertices))
    is_open = np.zeros(int(part.max(initial=-1)) + 1, bool)
    is_open[np.tile(part, 3)[open_edges(faces)]] = True
    open_faces = faces[is_open[part]]
    if len(open_faces) == 0:
        raise InputError(f"{source}: has no sheet to thicken: all of its parts are closed; leave thicken out")
    used = vertices[np.unique(open_faces)]
    extent = float(np.ptp(used, axis=0).max()) + thickness
    if extent * CELLS_PER_WALL / thickness > MAX_CELLS:
        least = extent * CELLS_PER_WALL / MAX_CELLS
        raise InputError(
            f"{source}: walls of {thickness:.3g} m are too thin for a mesh of {extent:.3g} m; "
            f"thicken it to at least {least:.2g} m"
        )
    middle = (used.min(axis=0) + used.max(axis=0)) / 2
    wall = Wall(MeshQuery(vertices - middle, open_faces), thickness)
    walls = polygonize(wall, int(np.ceil(extent * CELLS_PER_WALL / thickness)))
    walls.vertices = np.asarray(walls.vertices) + middle
    closed = trimesh.Trimesh(vertices, faces[~is_open[part]], process=False)
    closed.remove_unreferenced_vertices()
    if len(closed.faces) == 0:
        return walls
    joined = np.concatenate([np.asarray(walls.faces), np.asarray(closed.faces) + len(walls.vertices)])
    return trimesh.Trimesh(np.concatenate([walls.vertices, closed.vertices]), joined, process=False)


class Wall(Surface):
    """All points within half a ``thickness`` of triangles."""

    def __init__(self, query: MeshQuery, thickness: float) -> None:
        super().__init__()
        self.query, self.thickness = query, thickness

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,) in meters."""
        distance, _, _ = self.query.nearest(points.detach().double().numpy())
        return torch.from_numpy(distance).to(points) - self.thickness / 2

    def distance_and_normal(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance (N,) and unit normal (N, 3)."""
        own = points.detach().double().numpy()
        distance, face, closest = self.query.nearest(own)
        normal = self.query.normal(own, distance, face, closest, np.zeros(len(own), bool))
        return torch.from_numpy(distance).to(points) - self.thickness / 2, torch.from_numpy(normal).to(points)

    def bounds(self) -> Tensor:
        """The box (2, 3) around the walls."""
        used = self.query.vertices[np.unique(self.query.faces)]
        half = self.thickness / 2
        return torch.from_numpy(np.stack([used.min(axis=0) - half, used.max(axis=0) + half])).float()
