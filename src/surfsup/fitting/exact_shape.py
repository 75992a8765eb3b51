"""Shapes with exact signed distances, normals and surface points, scaled into the cube [-1, 1]³."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch

from surfsup.errors import InputError
from surfsup.sdf.mesh.query import MeshQuery, unit
from surfsup.sdf.neural.siren import Normalization
from surfsup.sdf.surface import Surface

if TYPE_CHECKING:
    import trimesh

PROBE_OFFSET = 2e-3  # distance to both sides of a triangle at which the inside is tested
NEAR = 0.1  # largest |d| of the samples near the surface
MAX_ATTEMPTS = 50  # of rejection sampling
MIN_BOUNDARY_SHARE = 0.01  # of a mesh's area that separates an inside from an outside


@dataclass(frozen=True)
class DistanceSamples:
    """Points with their exact distances and normals.

    Attributes:
        points: (N, 3) in the cube.
        distance: (N,) signed.
        normals: (N, 3) of length one, the gradient of the distance.
    """

    points: np.ndarray
    distance: np.ndarray
    normals: np.ndarray

    def select(self, which: np.ndarray) -> DistanceSamples:
        """The samples at ``which``, a mask or indices."""
        return DistanceSamples(self.points[which], self.distance[which], self.normals[which])


class ExactShape(ABC):
    """A solid in the cube [-1, 1]³ whose distances can be computed exactly.

    Attributes:
        normalization: the map of the input into the cube.
    """

    normalization: Normalization

    @abstractmethod
    def sample_surface(self, count: int, random: np.random.Generator) -> DistanceSamples:
        """About ``count`` points distributed uniformly over the surface.

        Raises:
            InputError: there is no surface.
        """

    @abstractmethod
    def samples_at(self, points: np.ndarray) -> DistanceSamples:
        """The samples at ``points`` (N, 3), without those whose distance is not known."""

    def sample_around(self, count: int, spreads: tuple[float, ...], random: np.random.Generator) -> DistanceSamples:
        """At most ``count`` points on the surface, displaced by normal noise with one of the standard deviations."""
        points = self.sample_surface(count, random).points
        spread = random.choice(spreads, size=(len(points), 1))
        return self.samples_at(points + random.normal(size=points.shape) * spread)

    def sample_cube(self, count: int, reach: float, random: np.random.Generator) -> DistanceSamples:
        """At most ``count`` points distributed uniformly over the cube [-reach, reach]³."""
        return self.samples_at(random.uniform(-reach, reach, size=(count, 3)))

    def sample_near(self, count: int, random: np.random.Generator) -> DistanceSamples:
        """About ``count`` points distributed uniformly over the space nearer than :data:`NEAR` to the surface."""
        found: list[DistanceSamples] = []
        while sum(len(one.points) for one in found) < count and len(found) < MAX_ATTEMPTS:
            candidates = self.sample_cube(2 * count, 1.0 + NEAR, random)
            found.append(candidates.select(np.abs(candidates.distance) < NEAR))
        joined = concatenate(found)
        return joined.select(np.arange(min(count, len(joined.points))))


class ExactMesh(ExactShape):
    """The solid of a triangle mesh, which may have holes.

    The winding number decides what is inside. Triangles that do not separate inside from outside (within a solid,
    doubled, loose) are not part of the surface; points nearest to such a triangle have no known distance.

    Args:
        mesh: in its own unit.
    """

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        self.normalization = normalize_extent(np.asarray(mesh.vertices))
        vertices = to_cube(np.asarray(mesh.vertices), self.normalization)
        self.query = MeshQuery(vertices, np.asarray(mesh.faces))
        corners = vertices[self.query.faces]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        self.cumulative_area = np.cumsum(area)

    def sample_surface(self, count: int, random: np.random.Generator) -> DistanceSamples:
        """About ``count`` points distributed uniformly over the surface.

        Raises:
            InputError: no triangle separates an inside from an outside.
        """
        points, faces = self.sample_triangles(count, random)
        normals = self.query.face_normals[faces]
        back = self.query.inside(points - PROBE_OFFSET * normals)
        front = self.query.inside(points + PROBE_OFFSET * normals)
        normals = np.where(front[:, None], -normals, normals)
        boundary = back != front
        if boundary.mean() < MIN_BOUNDARY_SHARE:
            raise InputError("the mesh: almost no triangle separates an inside from an outside; close its holes")
        return DistanceSamples(points, np.zeros(len(points)), normals).select(boundary)

    def sample_triangles(self, count: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Points (count, 3) distributed uniformly over all triangles, and the triangle of each (count,)."""
        faces = np.searchsorted(self.cumulative_area, random.uniform(0, self.cumulative_area[-1], count))
        first, second = random.uniform(size=(2, count, 1))
        swap = first + second > 1
        first, second = np.where(swap, 1 - first, first), np.where(swap, 1 - second, second)
        corners = self.query.vertices[self.query.faces[faces]]
        points = corners[:, 0] + first * (corners[:, 1] - corners[:, 0]) + second * (corners[:, 2] - corners[:, 0])
        return points, faces

    def samples_at(self, points: np.ndarray) -> DistanceSamples:
        """The samples at those of ``points`` (N, 3) whose nearest triangle is part of the surface."""
        distance, face, closest = self.query.nearest(points)
        inside = self.query.inside(points)
        normals = self.query.normal(points, distance, face, closest, inside)
        offset = PROBE_OFFSET * self.query.face_normals[face]
        boundary = self.query.inside(closest - offset) != self.query.inside(closest + offset)
        return DistanceSamples(points, np.where(inside, -distance, distance), unit(normals)).select(boundary)


class ExactSurface(ExactShape):
    """The solid of a surface with a closed-form distance, such as the procedural chairs and bowls.

    Args:
        surface: in its own unit, exact outside.
    """

    def __init__(self, surface: Surface) -> None:
        self.surface = surface
        box = surface.bounds().detach().double().numpy()
        self.normalization = normalize_extent(box)
        self.half_extent = to_cube(box[1:], self.normalization)[0]

    def sample_surface(self, count: int, random: np.random.Generator) -> DistanceSamples:
        """About ``count`` points on the surface, by projection of points near it along their normals.

        Raises:
            InputError: no point of the surface was found.
        """
        found: list[DistanceSamples] = []
        while sum(len(one.points) for one in found) < count:
            reach = self.half_extent + NEAR
            candidates = self.samples_at(random.uniform(-reach, reach, size=(2 * count, 3)))
            candidates = candidates.select(np.abs(candidates.distance) < NEAR)
            for _ in range(2):
                candidates = self.samples_at(candidates.points - candidates.distance[:, None] * candidates.normals)
            found.append(candidates.select(np.abs(candidates.distance) < PROBE_OFFSET))
            if len(found) == MAX_ATTEMPTS:
                raise InputError("the solid: no point of its surface was found; is it empty?")
        joined = concatenate(found)
        return joined.select(np.arange(min(count, len(joined.points))))

    def samples_at(self, points: np.ndarray) -> DistanceSamples:
        """The samples at ``points`` (N, 3)."""
        own = torch.from_numpy(points / self.normalization.scale + np.asarray(self.normalization.center)).float()
        with torch.no_grad():
            distance, normals = self.surface.distance_and_normal(own)
        return DistanceSamples(points, self.normalization.scale * distance.double().numpy(), normals.double().numpy())


def concatenate(parts: list[DistanceSamples]) -> DistanceSamples:
    """The samples of all ``parts``."""
    names = ("points", "distance", "normals")
    return DistanceSamples(*(np.concatenate([getattr(one, name) for one in parts]) for name in names))


def normalize_extent(points: np.ndarray) -> Normalization:
    """The map that centers the bounding box of ``points`` (N, 3) and makes its longest side 2."""
    lower, upper = points.min(axis=0), points.max(axis=0)
    x, y, z = ((lower + upper) / 2).tolist()
    return Normalization((x, y, z), float(2 / (upper - lower).max()))


def to_cube(points: np.ndarray, normalization: Normalization) -> np.ndarray:
    """Map ``points`` (N, 3) into the cube."""
    return (points - np.asarray(normalization.center)) * normalization.scale
