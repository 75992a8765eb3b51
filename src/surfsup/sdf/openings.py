"""Openings that a cut leaves where it reaches only a little beyond the solid, or ends at it.

A cup is a difference: a cylinder less one that reaches beyond its mouth. In the mouth the value is a bound, at most
half of what the cut reaches beyond, since there the nearest points of both parts are not on the solid. Where it is less
than the clearance of collision handling it closes the mouth by an invisible lid; a cut that ends at the mouth leaves a
sheet without thickness. So a value is tested: if it is the distance to a point of the solid, a little behind that point
is the solid's inside. Where it is not, the distance to the triangles of the zero set takes its place.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from surfsup.errors import InputError
from surfsup.sdf.combine import Union
from surfsup.sdf.edges import EdgedIntersection
from surfsup.sdf.marching_cubes import polygonize
from surfsup.sdf.mesh.query import MeshQuery
from surfsup.sdf.mesh.surface import MeshSurface
from surfsup.sdf.surface import Surface
from surfsup.sdf.transform import Transformed

SAMPLES = 200_000  # points in the bounding box, to find openings
MIN_SAMPLES = 10  # in an opening
MIN_GAIN = 0.5  # of the reach, by which the true distance exceeds the value there; beside curved edges it is less
BEHIND = (0.02, 0.1, 0.3)  # of the reach: how far behind the nearest point the solid is looked for
MAX_QUERIES = 500
RESOLUTION, COARSE = 160, 48  # cells of marching cubes along the longest side: for distances, to find openings


def with_openings(surface: Surface, reach: float) -> Surface:
    """``surface`` with open openings; itself where its values are no less than ``reach`` in each of them.

    Args:
        surface: with the distance beside edges (:func:`surfsup.sdf.edges.with_edges`).
        reach: meters, beyond which a bound does no harm.
    """
    if isinstance(surface, Transformed):
        inner = with_openings(surface.surface, reach / float(surface.scale))
        if inner is surface.surface:
            return surface
        return Transformed(inner, surface.rotation, surface.translation, surface.scale)
    if isinstance(surface, Union):
        parts = [with_openings(part, reach) for part in surface.parts]
        return surface if all(new is old for new, old in zip(parts, surface.parts, strict=True)) else Union(*parts)
    return opened(surface, reach) if isinstance(surface, EdgedIntersection) else surface


@torch.no_grad()
def opened(surface: Surface, reach: float) -> Surface:
    """``surface`` with open openings; itself without any, or with walls too thin for the grid of its triangles."""
    lower, upper = surface.bounds().detach().cpu()
    if not bool((lower < upper).all()):
        return surface
    places = torch.from_numpy(np.random.default_rng(0).random((SAMPLES, 3), np.float32))
    points = lower - reach + places * (upper - lower + 2 * reach)
    missed, distance, _ = unattained(surface, points, reach)
    if int(missed.sum()) < MIN_SAMPLES:
        return surface
    try:
        if not gains(surface, points[missed][:MAX_QUERIES], distance[missed][:MAX_QUERIES], MIN_GAIN * reach):
            return surface
        found = OpenCut(surface, reach)
    except InputError:  # no part of the solid is larger than a cell
        return surface
    inside = points[distance < 0]
    kept = not len(inside) or float(found.triangles.distance(inside).max()) < found.cell
    return found if kept else surface


def gains(surface: Surface, points: Tensor, bound: Tensor, gain: float) -> bool:
    """Whether the distances at enough ``points`` (N, 3) exceed their ``bound`` (N,) by ``gain`` meters."""
    mesh = polygonize(surface, COARSE)
    to_triangles, _, _ = MeshQuery(np.asarray(mesh.vertices), np.asarray(mesh.faces)).nearest(points.double().numpy())
    lower, upper = surface.bounds()
    cell = float((upper - lower).max()) / COARSE
    return int((torch.from_numpy(to_triangles).to(bound) - bound > gain + cell).sum()) >= MIN_SAMPLES


def unattained(surface: Surface, points: Tensor, reach: float) -> tuple[Tensor, Tensor, Tensor]:
    """Which values (N,) at ``points`` (N, 3) are below ``reach`` and distances to no point; values and normals."""
    distance, normal = surface.distance_and_normal(points)
    near = (distance > 0) & (distance < reach)
    missed = torch.zeros_like(near)
    depths = distance[near, None] + reach * distance.new_tensor(BEHIND)
    behind = points[near, None] - depths[:, :, None] * normal[near, None]
    with torch.no_grad():
        missed[near] = (surface.distance(behind.reshape(-1, 3)) > 0).reshape(depths.shape).all(dim=1)
    return missed, distance, normal


class OpenCut(Surface):
    """The solid of ``surface`` with the distance to its triangles where its own value is attained nowhere.

    Zero set and sign are those of ``surface``. The triangles cut off sharp edges by up to half a cell of marching
    cubes, so a cell is subtracted: the value stays a bound.

    Raises:
        InputError: No part of the solid is larger than a cell.
    """

    def __init__(self, surface: Surface, reach: float) -> None:
        super().__init__()
        self.surface, self.reach = surface, reach
        self.triangles = MeshSurface(polygonize(surface, RESOLUTION))
        lower, upper = surface.bounds().detach()
        self.cell = float((upper - lower).max()) / RESOLUTION

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,)."""
        return self.distance_and_normal(points)[0]

    def distance_and_normal(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance (N,) and normal (N, 3)."""
        missed, distance, normal = unattained(self.surface, points, self.reach)
        if not bool(missed.any()):
            return distance, normal
        to_triangles, away = self.triangles.distance_and_normal(points[missed])
        bound, own = distance[missed], normal[missed]
        further = to_triangles - self.cell > bound
        distance, normal = distance.clone(), normal.clone()
        distance[missed] = torch.where(further, to_triangles - self.cell, bound)
        normal[missed] = torch.where(further[:, None], away, own)
        return distance, normal

    def bounds(self) -> Tensor:
        """The box of the surface (2, 3)."""
        return self.surface.bounds()
